//! Rigs whose truth is known, captured without images by a simulator that shares no code with the fit.

use crate::support;
use depthcal_calibration::calibrate::CalibrateError;
use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, Evidence, calibrate};
use depthcal_calibration::calibration_record::calibration_record;
use depthcal_calibration::camera_record::cameras_from_record;
use depthcal_calibration::judge::evaluate::evaluate;
use depthcal_calibration::rig_simulated::{errors, rig_capture, squared_error, true_cameras};
use depthcal_calibration::start::views::ExtrinsicsError;
use depthcal_io::Calibration;
use depthcal_model::Register;
use depthcal_simulate::{Kind, RigPoints};

fn options() -> CalibrateOptions {
    CalibrateOptions { lens: Some("brown-conrady:full".to_owned()), ..CalibrateOptions::default() }
}

fn fit(points: &RigPoints) -> Calibrated {
    calibrate(&rig_capture(points), &options()).expect("a calibration")
}

/// Places, both pinholes, both lenses and D come back within their own standard deviations: 99 % of all within three, and the
/// normalised squared error of all seeds together within its 99.9 % interval.
#[test]
fn parameters_of_two_cameras_come_back_within_their_standard_deviations() {
    let (mut within, mut all, mut squared, mut freedom) = (0, 0, 0.0, 0);
    for seed in 0..6 {
        let points = support::two_cameras(seed, Kind::General(1));
        let fit = fit(&points);
        let errors = errors(&fit, &points.truth);
        // The place, 4 + 5 + 4 of infrared, 4 + 5 of colour.
        assert_eq!(errors.len(), 28, "seed {seed}");
        within += errors.iter().filter(|(i, e)| e.abs() <= 3.0 * fit.std_dev(*i)).count();
        all += errors.len();
        let (value, n) = squared_error(&fit, &errors).expect("a regular covariance");
        squared += value;
        freedom += n;
        let place = &fit.cameras[1];
        let translation = place.camera_from_rig.translation.vector;
        assert!((translation.x - 52.3).abs() < 1.0 && (translation.y + 1.4).abs() < 1.0, "seed {seed}: {translation}");
    }
    assert!(within as f64 >= 0.98 * all as f64, "{within} of {all} within three standard deviations");
    // χ² of n degrees of freedom has the variance 2 n.
    let off = (squared - freedom as f64) / (2.0 * freedom as f64).sqrt();
    assert!(off.abs() < 3.3, "normalised squared error {squared:.0} of {freedom} degrees of freedom");
}

/// On another capture, markers taken through corrected depth into the colour image are as far off as with the true rig, which
/// the noise of depth and markers alone makes, while depth as measured is worse.
#[test]
fn transfer_errors_are_those_of_the_true_rig() {
    let points = support::two_cameras(11, Kind::General(1));
    let fit = fit(&points);
    let held_out = support::two_cameras(12, Kind::General(2));
    let capture = rig_capture(&held_out);
    let ours = evaluate(&fit.placed(), &capture);
    let truth = true_cameras(&held_out.truth, &Register::builtin()).expect("pieces");
    let oracle = evaluate(&truth, &capture);
    assert_eq!(ours.transfers.len(), 1, "colour has no depth");
    let (ours, oracle) = (&ours.transfers[0], &oracle.transfers[0]);
    assert_eq!((ours.from.as_str(), ours.to.as_str()), ("infrared", "colour"));
    assert!(ours.points.len() > 500);
    let record = ours.record("x");
    assert!(ours.rms_px() < 1.05 * oracle.rms_px(), "{} against the oracle's {}", ours.rms_px(), oracle.rms_px());
    assert!(record.before_rms_px > 1.5 * record.rms_px, "{record:?}");
    for (a, b) in ours.by_distance().iter().zip(oracle.by_distance()) {
        assert!(a.rms_mm < 1.08 * b.rms_mm, "at {:.0} mm: {} against {}", a.distance_mm, a.rms_mm, b.rms_mm);
    }
}

/// A calibration file gives the cameras back to the bit, names every row of the covariance with its camera, and reads as the
/// reference alone.
#[test]
fn the_file_holds_the_rig() {
    let points = support::two_cameras(3, Kind::Centered1);
    let fit = fit(&points);
    let fitted = evaluate(&fit.placed(), &rig_capture(&points));
    let reference = depthcal_io::FileReference { path: "captures".into(), digest: "0".repeat(64) };
    let record = calibration_record(&fit, &fitted, reference, None);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration.json");
    record.write(&path).unwrap();
    let read = Calibration::read(&path).unwrap();
    let cameras = cameras_from_record(&read, &Register::builtin()).unwrap();
    for (read, own) in cameras.iter().zip(fit.placed()) {
        assert_eq!(read.name, own.name);
        assert_eq!(read.camera.theta(), own.camera.theta());
        assert!((read.camera_from_rig.inverse() * own.camera_from_rig).translation.vector.norm() < 1e-9);
    }
    let covariance = read.covariance.as_ref().unwrap();
    let variance = covariance.get("colour/camera_from_rig.tx", "colour/camera_from_rig.tx").unwrap();
    let std_dev = read.others[0].camera_from_rig.std_dev.unwrap().translation_mm[0];
    assert!((variance.sqrt() / std_dev - 1.0).abs() < 1e-9);
    assert!(covariance.get("infrared/pinhole.fx", "colour/pinhole.fx").unwrap() != 0.0, "cameras are correlated");
    assert!(read.frames[0].reprojection_rms_px > 0.0 && read.frames[0].depth_rms_mm.is_some());
}

/// Results have the same bits on one thread and on two.
#[test]
fn the_number_of_threads_changes_nothing() {
    let points = support::two_cameras(5, Kind::Centered1);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let fit = pool.install(|| fit(&points));
        fit.placed().iter().flat_map(|c| c.camera.theta()).map(f64::to_bits).collect::<Vec<_>>()
    };
    assert_eq!(run(1), run(2));
}

/// Frames whose images are exchanged, or whose board moved between the exposures, are named and left out, and change nothing
/// else.
#[test]
fn frames_that_contradict_are_found_and_named() {
    let points = support::two_cameras(7, Kind::General(1));
    let clean = calibrate(&rig_capture(&points), &options()).unwrap();
    let mut capture = rig_capture(&points);
    let shared: Vec<String> = {
        let in_colour = |name: &String| capture.cameras[1].capture.frames.iter().any(|f| f.name == *name);
        capture.frame_names().into_iter().filter(in_colour).collect()
    };
    let place = |camera: usize, capture: &depthcal_calibration::observe::Capture, name: &str| {
        capture.cameras[camera].capture.frames.iter().position(|f| f.name == name).unwrap()
    };
    // One frame has the colour markers of another.
    let (first, other) = (shared[4].clone(), shared[9].clone());
    let (a, b) = (place(1, &capture, &first), place(1, &capture, &other));
    capture.cameras[1].capture.frames[a].markers = capture.cameras[1].capture.frames[b].markers.clone();
    let fit = calibrate(&capture, &options()).unwrap();
    let dropped = &fit.cameras[1].calibrated.capture.dropped;
    assert!(dropped.len() == 1 && dropped[0].name == first, "{dropped:?}");
    assert!(dropped[0].reason.contains("px from where infrared sees it"), "{}", dropped[0].reason);
    let apart = (fit.cameras[1].camera_from_rig.inverse() * clean.cameras[1].camera_from_rig).translation.vector.norm();
    assert!(apart < 3.0 * fit.cameras[1].place_std_dev.unwrap()[3..].iter().copied().fold(0.0, f64::max), "{apart}");
    assert_eq!(fit.pairs[0].contradicting, 1);
}

/// Two frames whose colour images are exchanged are both named, and the places are those of the other frames.
#[test]
fn exchanged_images_are_both_named() {
    let points = support::two_cameras(7, Kind::General(1));
    let mut capture = rig_capture(&points);
    let infrared: Vec<String> = capture.cameras[0].capture.frames.iter().map(|f| f.name.clone()).collect();
    let frames = &mut capture.cameras[1].capture.frames;
    let shared: Vec<usize> = (0..frames.len()).filter(|i| infrared.contains(&frames[*i].name)).collect();
    let (a, b) = (shared[3], shared[11]);
    let names = [frames[a].name.clone(), frames[b].name.clone()];
    let markers = std::mem::take(&mut frames[a].markers);
    frames[a].markers = std::mem::replace(&mut frames[b].markers, markers);
    let fit = calibrate(&capture, &options()).unwrap();
    let mut dropped: Vec<&str> = fit.cameras[1].calibrated.capture.dropped.iter().map(|d| d.name.as_str()).collect();
    dropped.sort_unstable();
    assert_eq!(dropped, names);
    assert_eq!(fit.pairs[0].contradicting, 2);
    let errors = errors(&fit, &points.truth);
    let within = errors.iter().filter(|(i, e)| e.abs() <= 3.5 * fit.std_dev(*i)).count();
    assert_eq!(within, errors.len());
}

/// A camera that was bumped in the middle of the session is found, with both places.
#[test]
fn a_camera_that_moved_is_found() {
    let before = support::two_cameras(8, Kind::General(1));
    let mut bumped = support::colour();
    let turn = depthcal_simulate::Pose::from_rotation_vector([0.0, 0.04, 0.0], [6.0, 0.0, 0.0]);
    bumped.camera_from_rig = turn.after(&bumped.camera_from_rig);
    let rig = depthcal_simulate::RigSimulation::new(vec![support::infrared(), bumped], Kind::General(1), 8);
    let after = rig.observe_points(&depthcal_simulate::PointOptions::default()).unwrap();
    let mut capture = rig_capture(&before);
    let later = rig_capture(&after);
    for frame in &mut capture.cameras[1].capture.frames {
        let moved = later.cameras[1].capture.frames.iter().find(|f| f.name == frame.name);
        if let Some(moved) = moved.filter(|f| f.name.as_str() >= "0017") {
            *frame = moved.clone();
        }
    }
    match calibrate(&capture, &options()).unwrap_err() {
        CalibrateError::Extrinsics(ExtrinsicsError::Moved { camera, other, second_frames, angle_deg, .. }) => {
            assert_eq!((camera.as_str(), other.as_str()), ("colour", "infrared"));
            assert!(second_frames.contains("0017") && !second_frames.contains("0016"), "{second_frames}");
            assert!((angle_deg - 0.04_f64.to_degrees()).abs() < 0.2, "{angle_deg}");
        }
        error => panic!("{error}"),
    }
}

/// Cameras that never see the board together cannot be connected, and the message says which.
#[test]
fn cameras_without_common_frames_are_named() {
    let points = support::two_cameras(9, Kind::General(1));
    let mut capture = rig_capture(&points);
    for frame in &mut capture.cameras[1].capture.frames {
        frame.name = format!("other_{}", frame.name);
    }
    let error = calibrate(&capture, &options()).unwrap_err();
    assert!(
        matches!(&error, CalibrateError::Extrinsics(ExtrinsicsError::Unconnected { camera, .. }) if camera == "colour"),
        "{error}"
    );
    assert!(error.to_string().contains("within_s") && !error.is_untrusted_fit());
}

/// A camera that exposes while the board moves on sees every board somewhere else: alone it is as good as any, and in the rig it
/// is refused, by `calibrate` itself.
#[test]
fn a_camera_that_contradicts_the_others_is_refused() {
    let mut capture = rig_capture(&support::two_cameras(3, Kind::General(1)));
    for (number, frame) in capture.cameras[1].capture.frames.iter_mut().enumerate() {
        let (sin, cos) = (2.4 * number as f64).sin_cos();
        for marker in &mut frame.markers {
            marker.pixel[0] += 12.0 * sin;
            marker.pixel[1] += 12.0 * cos;
        }
    }
    let refused = calibrate(&capture, &options()).expect_err("a contradiction");
    let CalibrateError::RigContradiction(contradiction) = refused else { panic!("{refused}") };
    let Evidence::Noise { joint_px, alone_px } = contradiction.evidence else { panic!("{contradiction:?}") };
    assert!(joint_px > 3.0 * alone_px, "{contradiction:?}");
}
