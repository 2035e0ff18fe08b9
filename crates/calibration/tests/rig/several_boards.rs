//! Several boards at once, each with a pose of its own in every frame.

use crate::support;
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::observe::Capture;
use depthcal_calibration::rig_simulated::{errors, pose, rig_capture, squared_error};
use depthcal_model::{NumberedBoard, Pattern, Target};
use depthcal_simulate::{Board, Kind, PointOptions, RigPoints, RigSimulation};
use depthcal_statistics::chi_squared_tail;

/// Frames of each board.
const FRAMES: usize = 14;

/// A board alone before the rig; boards differ in size.
fn alone(board: Board, seed: u64) -> RigPoints {
    let rig = RigSimulation::new(vec![support::infrared(), support::colour()], Kind::General(1), seed);
    rig.board(board).frames(FRAMES).observe_points(&PointOptions::default()).expect("a simulation")
}

/// Both boards in every frame, as a dataset of several boards gives them.
fn together(first: &RigPoints, second: &RigPoints) -> Capture {
    let (mut both, other) = (rig_capture(first), rig_capture(second));
    for (camera, other) in both.cameras.iter_mut().zip(other.cameras) {
        let numbered =
            |name: &str, board: &Target| NumberedBoard { name: name.into(), first_tag: 0, board: board.clone() };
        let target =
            Target::several(vec![numbered("wall", &camera.capture.target), numbered("floor", &other.capture.target)]);
        let offset = target.parts()[1].markers.start;
        for mut frame in other.capture.frames {
            frame.raw.name.push_str("+floor");
            frame.raw.board = 1;
            frame.markers.iter_mut().for_each(|marker| marker.index += offset);
            camera.capture.frames.push(frame);
        }
        camera.capture.target = target;
    }
    both
}

#[test]
fn two_boards_have_a_pose_each_and_one_rig() {
    let chessboard =
        |columns, rows, spacing_mm| Board::new(depthcal_simulate::Pattern::Chessboard, columns, rows, spacing_mm);
    let (first, second) = (alone(chessboard(9, 6, 25.0), 1), alone(chessboard(6, 5, 40.0), 2));
    let capture = together(&first, &second);
    assert!(matches!(capture.cameras[0].capture.target.pattern, Pattern::Several { .. }));
    let options = CalibrateOptions { lens: Some("brown-conrady:full".to_owned()), ..CalibrateOptions::default() };
    let fit = calibrate(&capture, &options).expect("a fit");
    assert_eq!(fit.frames.iter().filter(|frame| frame.board == 1).count(), FRAMES);
    // Both truths are of one rig.
    let errors = errors(&fit, &first.truth);
    let (squared, freedom) = squared_error(&fit, &errors).expect("a covariance");
    assert!(chi_squared_tail(squared, freedom) > 1e-3, "{squared} of {freedom}");
    for (row, error) in &errors {
        let sigma = fit.std_dev(*row);
        assert!(error.abs() < 3.5 * sigma, "{}: {error} ± {sigma}", fit.parameters()[*row].0);
    }
    for (points, ending, board) in [(&first, "", 0), (&second, "+floor", 1)] {
        for truth in &points.truth.cameras[0].truth.frames {
            let name = format!("{}{ending}", truth.name);
            let Some(frame) = fit.frames.iter().find(|frame| frame.name == name) else { continue };
            assert_eq!(frame.board, board);
            let error = frame.rig_from_board * pose(&truth.pose).inverse();
            assert!(error.rotation.angle() < 0.003, "{name}: {}", error.rotation.angle());
        }
    }
    // With twice the frames the rig is known better than from one board.
    let one = calibrate(&rig_capture(&first), &options).expect("a fit");
    let place = |fit: &depthcal_calibration::calibrate::Calibrated| fit.cameras[1].place_std_dev.expect("a place");
    assert!(place(&fit).iter().zip(place(&one)).all(|(both, one)| *both < one));
}
