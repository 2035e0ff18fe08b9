//! A camera is a rig of one.

use crate::support;
use depthcal_calibration::adjust::adjustment::Adjustment;
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::rig_simulated::{errors, rig_capture, squared_error};
use depthcal_simulate::{Kind, PointOptions, RigPoints, RigSimulation};

fn observed(seed: u64) -> RigPoints {
    let rig = RigSimulation::new(vec![support::infrared()], Kind::General(1), seed);
    rig.observe_points(&PointOptions::default()).expect("a simulation")
}

/// The fit of a camera that is alone has the state of a rig: adjusted again, as that of several cameras is by a cross-validation,
/// it stays where it is, up to a small part of every parameter's standard deviation.
#[test]
fn a_camera_alone_is_a_rig_of_one() {
    let fit = calibrate(&rig_capture(&observed(3)), &CalibrateOptions::default()).expect("a calibration");
    let alone = fit.only_camera().expect("one camera");
    let again = Adjustment::of_state(&fit.state, true).expect("a problem").solve_within(1e-9).expect("a solution");
    let names = fit.parameters();
    let thetas = alone.camera.theta().into_iter().zip(again.cameras[0].camera.theta());
    for (row, (alone, again)) in thetas.enumerate() {
        let off = (alone - again).abs();
        assert!(off <= 1e-2 * fit.std_dev(row), "{}: {alone} {again} ± {}", names[row].0, fit.std_dev(row));
    }
    assert_eq!(fit.capture().cameras[0].capture.frames.len(), fit.frames.len());
    assert!(names.iter().any(|(name, free)| name == "pinhole.fx" && *free), "{names:?}");
}

/// eᵀ Σ⁻¹ e has as many degrees of freedom as there are parameters: over 20 captures with some 14 parameters its mean per degree
/// of freedom has a standard deviation of √(2 / 280) = 0.085. With standard deviations at the measured instead of the predicted
/// depth it is larger: samples that noise moves away then weigh less than those that it moves near.
#[test]
fn errors_are_as_large_as_their_covariance_says() {
    const SEEDS: u64 = 20;
    let (mut squared, mut freedom) = (0.0, 0);
    for seed in 0..SEEDS {
        let points = observed(100 + seed);
        let fit = calibrate(&rig_capture(&points), &CalibrateOptions::default()).expect("a calibration");
        let (value, n) = squared_error(&fit, &errors(&fit, &points.truth)).expect("a regular covariance");
        squared += value;
        freedom += n;
    }
    let per_freedom = squared / freedom as f64;
    println!("{per_freedom:.3} per degree of freedom of {freedom}");
    assert!((per_freedom - 1.0).abs() < 3.0 * (2.0 / freedom as f64).sqrt(), "{per_freedom} of {freedom}");
}
