//! Invariances of a calibration: the order of the frames, the end at which the board's markers are counted from, the unit of
//! length.

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::observe::{CameraFrames, MeasuredDepth};
use depthcal::calibration::simulated;
use depthcal_simulate::{Board, CameraTruth, Kind, Pattern, PointOptions, Simulation};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEEDS: u64 = 6;
/// An adjustment ends where its parameters are within some 0.005 standard deviations of the optimum.
const STANDARD_DEVIATIONS: f64 = 0.03;

/// A chessboard, which looks the same after half a turn.
fn capture(seed: u64) -> CameraFrames {
    let camera = CameraTruth::published(1 + (seed % 4) as usize).unwrap();
    let board = Board { pattern: Pattern::Chessboard, columns: 9, rows: 6, spacing_mm: 25.0, ..Board::default() };
    let simulation = Simulation::new(camera, Kind::General(1), &[], seed).board(board);
    simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap())
}

/// Parameters of the camera with their standard deviations, 0 for those that were not estimated.
fn fitted(capture: &CameraFrames) -> Vec<(f64, f64)> {
    let result = calibrate_camera(capture, &CameraOptions::default()).unwrap();
    assert!(result.capture.dropped.is_empty(), "{:?}", result.capture.dropped);
    let covariance = result.covariance.unwrap();
    result.camera.theta().into_iter().enumerate().map(|(i, p)| (p, covariance[(i, i)].max(0.0).sqrt())).collect()
}

/// `scales` is what each parameter of the second fit is multiplied by first.
fn equal(what: &str, one: &[(f64, f64)], other: &[(f64, f64)], scales: &[f64]) {
    assert_eq!(one.len(), other.len());
    for (i, (((a, std), (b, other_std)), scale)) in one.iter().zip(other).zip(scales).enumerate() {
        let (b, other_std) = (b * scale, other_std * scale);
        assert!((a - b).abs() <= STANDARD_DEVIATIONS * std, "{what}: parameter {i} is {a} or {b}, of {std}");
        assert!((std - other_std).abs() <= 0.01 * std, "{what}: standard deviation {i} is {std} or {other_std}");
    }
}

#[test]
fn frames_may_come_in_any_order() {
    for seed in 0..SEEDS {
        let mut capture = capture(seed);
        let before = fitted(&capture);
        capture.frames.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        equal("order", &before, &fitted(&capture), &vec![1.0; before.len()]);
    }
}

#[test]
fn the_board_may_be_turned() {
    for seed in 0..SEEDS {
        let mut capture = capture(seed);
        let before = fitted(&capture);
        let (last, mut rng) = (capture.target.len() - 1, ChaCha8Rng::seed_from_u64(seed));
        let mut turned = 0;
        for frame in capture.frames.iter_mut().filter(|_| rng.random_bool(0.5)) {
            frame.markers.iter_mut().for_each(|marker| marker.index = last - marker.index);
            frame.markers.reverse();
            turned += 1;
        }
        assert!(turned > 2);
        equal("turn", &before, &fitted(&capture), &vec![1.0; before.len()]);
    }
}

/// Where everything is ten times as large, angles and focal lengths stay, and D's coefficients of the ray and its offset, which
/// are inverse depths, are a tenth.
#[test]
fn lengths_may_have_any_unit() {
    const SCALE: f64 = 10.0;
    for seed in 0..SEEDS {
        let mut capture = capture(seed);
        let before = fitted(&capture);
        capture.target.spacing_mm *= SCALE;
        for frame in &mut capture.frames {
            if let MeasuredDepth::Pixels(pixels) = &mut frame.raw.depth {
                pixels.iter_mut().for_each(|pixel| pixel.depth_mm *= SCALE);
            }
        }
        let mut scales = vec![1.0; before.len()];
        let d = before.len() - 4;
        scales[d..d + 3].fill(SCALE);
        equal("unit", &before, &fitted(&capture), &scales);
    }
}
