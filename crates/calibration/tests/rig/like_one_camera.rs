//! A rig has what one camera has: cross-validation, priors, planes of its frames.

use std::sync::Arc;

use crate::support;
use depthcal_calibration::adjust::camera_prior::CameraPrior;
use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, calibrate};
use depthcal_calibration::judge::camera::EvaluatedFrame;
use depthcal_calibration::judge::capture_cross_validation::cross_validate;
use depthcal_calibration::judge::evaluate::{Evaluated, evaluate};
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::observe::Capture;
use depthcal_calibration::rig_simulated::{errors, rig_capture, squared_error};
use depthcal_simulate::Kind;
use nalgebra::{DMatrix, DVector};

fn options() -> CalibrateOptions {
    CalibrateOptions { lens: Some("brown-conrady:full".to_owned()), ..CalibrateOptions::default() }
}

fn fitted(capture: &Capture, options: &CalibrateOptions) -> Calibrated {
    calibrate(capture, options).expect("a calibration")
}

fn reprojection_px(evaluated: &Evaluated) -> Vec<f64> {
    evaluated.records().iter().map(|record| record.reprojection_px.expect("images").rms).collect()
}

/// Every frame is judged once, by a rig that was fitted without it: with errors near those of a rig that was refitted from the
/// start, and above those of the frames that were fitted.
#[test]
fn frames_are_judged_by_a_rig_that_was_fitted_without_them() {
    let capture = rig_capture(&support::two_cameras(4, Kind::General(1)));
    let fit = fitted(&capture, &options());
    let validated =
        cross_validate(&fit, &capture, 4, Parts::Interleaved, &CalibrateOptions::default()).expect("errors");
    let on_fitted = evaluate(&fit.placed(), &capture);
    for ((_, validated), (_, fitted)) in validated.cameras.iter().zip(&on_fitted.cameras) {
        let names = |frames: &[EvaluatedFrame]| frames.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
        assert_eq!(validated.name, fitted.name);
        assert_eq!(names(&validated.frames), names(&fitted.frames));
    }
    assert_eq!(validated.transfers.len(), on_fitted.transfers.len());
    assert_eq!(validated.transfers[0].points.len(), on_fitted.transfers[0].points.len());
    let mut by_hand = Vec::new();
    let names = capture.frame_names();
    for part in 0..4 {
        let is_held = |name: &str| names.iter().position(|n| n == name).is_some_and(|i| i % 4 == part);
        let refitted = fitted(&capture.subset(|name| !is_held(name)), &options());
        by_hand.push(evaluate(&refitted.placed(), &capture.subset(is_held)));
    }
    for camera in 0..2 {
        let mean_square = by_hand.iter().map(|e| reprojection_px(e)[camera].powi(2)).sum::<f64>() / 4.0;
        let ratio = reprojection_px(&validated)[camera] / mean_square.sqrt();
        // Parts are of frames with few markers and others apart, so that a few frames are in another part.
        assert!((ratio - 1.0).abs() < 0.02, "camera {camera}: {ratio}");
        assert!(reprojection_px(&validated)[camera] > reprojection_px(&on_fitted)[camera]);
    }
}

/// A prior of one camera holds its focal length, and nothing of the other camera but what follows from it.
#[test]
fn the_prior_of_one_camera_is_used_for_it_alone() {
    let capture = rig_capture(&support::two_cameras(5, Kind::General(1)));
    let without = fitted(&capture, &options());
    let focal = without.cameras[1].calibrated.camera.pinhole()[0];
    let sigma = without.cameras[1].calibrated.std_devs();
    let names: Vec<String> = depthcal_calibration::calibrate::parameter_names(&without.cameras[1].calibrated.camera)
        .into_iter()
        .map(|n| n.0)
        .collect();
    let fx = names.iter().position(|name| name == "pinhole.fx").expect("a focal length");
    let sigma = sigma[fx].expect("a standard deviation");
    // A prior as certain as the captures, two standard deviations off, moves the estimate about half way.
    let prior = CameraPrior {
        units: 2,
        names: vec!["pinhole.fx".to_owned()],
        mean: DVector::from_element(1, focal + 2.0 * sigma),
        covariance: DMatrix::from_element(1, 1, sigma * sigma),
    };
    let given = CalibrateOptions { priors: vec![("colour".to_owned(), Arc::new(prior))], ..options() };
    let with = fitted(&capture, &given);
    let moved = (with.cameras[1].calibrated.camera.pinhole()[0] - focal) / sigma;
    assert!((moved - 1.0).abs() < 0.2, "{moved}");
    assert!(with.cameras[1].calibrated.prior.is_some() && with.cameras[0].calibrated.prior.is_none());
}

/// Frames whose depth has planes of its own: the standard deviations of the rig's parameters cover them.
#[test]
fn standard_deviations_of_a_rig_cover_planes_of_frames() {
    let (mut squared, mut freedom) = (0.0, 0);
    for seed in 0..6 {
        let points = support::two_cameras(20 + seed, Kind::General(1));
        let mut capture = rig_capture(&points);
        for (number, frame) in capture.cameras[0].capture.frames.iter_mut().enumerate() {
            // The same planes in every run: offsets and tilts of some micrometres per metre of inverse depth.
            let phase = (number as f64 * 7.0 + seed as f64) * 2.399_963;
            let plane = [2e-6 * phase.sin(), 3e-6 * (1.7 * phase).cos(), 3e-6 * (2.3 * phase).sin()];
            for pixel in frame.raw.depth_pixels_mut() {
                let [x, y] = [0, 1].map(|i| (pixel.context.pixel[i] - [312.97, 242.49][i]) / 476.9);
                pixel.depth_mm = 1.0 / (1.0 / pixel.depth_mm + plane[0] + plane[1] * x + plane[2] * y);
            }
        }
        let fit = fitted(&capture, &options());
        assert!(fit.cameras[0].calibrated.noise.planes.of_noise > 0.0, "the planes are seen");
        let (value, n) = squared_error(&fit, &errors(&fit, &points.truth)).expect("a regular covariance");
        squared += value;
        freedom += n;
    }
    // χ² of n degrees of freedom has the variance 2 n; without the planes the value is several times n.
    let off = (squared - freedom as f64) / (2.0 * freedom as f64).sqrt();
    assert!(off < 4.0, "normalised squared error {squared:.0} of {freedom} degrees of freedom");
}
