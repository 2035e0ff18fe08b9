//! A camera is a rig of one.

use crate::support;
use depthcal_calibration::calibrate::rig::{RigOptions, calibrate_rig};
use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, calibrate};
use depthcal_calibration::rig_simulated::{errors, rig_capture, squared_error};
use depthcal_simulate::{Kind, PointOptions, RigPoints, RigSimulation};

fn observed(seed: u64) -> RigPoints {
    let rig = RigSimulation::new(vec![support::infrared()], Kind::General(1), seed);
    rig.observe_points(&PointOptions::default()).expect("a simulation")
}

fn calibrated(points: &RigPoints) -> Calibrated {
    calibrate(&rig_capture(points).cameras[0].capture, &CalibrateOptions::default()).expect("a calibration")
}

/// The calibration of a camera and that of a rig of this camera alone are one adjustment. Because their start values differ,
/// they end at values that differ by a small part of every parameter's standard deviation.
#[test]
fn a_camera_alone_is_a_rig_of_one() {
    let points = observed(3);
    let rig = calibrate_rig(&rig_capture(&points), &RigOptions::default()).expect("a calibration");
    let alone = calibrated(&points);
    let in_rig = &rig.cameras[0].calibrated;
    let differences = alone.camera.theta().into_iter().zip(in_rig.camera.theta()).zip(in_rig.std_devs());
    for ((alone, in_rig), std_dev) in differences {
        assert!((alone - in_rig).abs() <= 1e-3 * std_dev.unwrap_or(0.0), "{alone} {in_rig} {std_dev:?}");
    }
    assert_eq!(alone.capture.frames.len(), in_rig.capture.frames.len());
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
        let mut fit = calibrate_rig(&rig_capture(&points), &RigOptions::default()).expect("a calibration");
        let alone = calibrated(&points);
        fit.covariance = alone.covariance.clone().expect("a covariance");
        fit.cameras[0].calibrated = alone;
        let (value, n) = squared_error(&fit, &errors(&fit, &points.truth)).expect("a regular covariance");
        squared += value;
        freedom += n;
    }
    let per_freedom = squared / freedom as f64;
    println!("{per_freedom:.3} per degree of freedom of {freedom}");
    assert!((per_freedom - 1.0).abs() < 3.0 * (2.0 / freedom as f64).sqrt(), "{per_freedom} of {freedom}");
}
