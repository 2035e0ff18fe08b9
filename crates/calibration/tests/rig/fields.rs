//! Fields of the cameras of a rig, and formulas of one name that mean something else for each.

use crate::support;
use depthcal_calibration::calibrate::{
    CalibrateOptions, Calibrated, CalibratedCamera, CameraOptions, EffectOf, calibrate, calibrate_camera,
};
use depthcal_calibration::calibration_record::calibration_record;
use depthcal_calibration::camera_record::cameras_from_record;
use depthcal_calibration::judge::evaluate::evaluate_fitted;
use depthcal_calibration::observe::Capture;
use depthcal_calibration::rig_simulated::rig_capture;
use depthcal_formula::FormulaFile;
use depthcal_io::{Calibration, FileReference};
use depthcal_model::Register;
use depthcal_simulate::{Effect, Kind, PointOptions, RigCamera, RigSimulation};

/// Two depth cameras with images, the first of which has a smooth error over its image.
fn capture(frames: usize) -> Capture {
    let first = support::infrared().effect(Effect::new("smooth_map", 6.0).expect("an effect"));
    let second = RigCamera::usual("infrared2", 1).expect("camera 2").expect("a usual camera");
    let rig = RigSimulation::new(vec![first, second], Kind::General(1), 5).frames(frames);
    rig_capture(&rig.observe_points(&PointOptions::default()).expect("a simulation"))
}

fn with_field(camera: Option<&str>, field: &str) -> CalibrateOptions {
    let effects = vec![EffectOf { camera: camera.map(str::to_owned), effect: field.parse().expect("an effect") }];
    CalibrateOptions { effects, ..CalibrateOptions::default() }
}

fn depth_rms_mm(camera: &CalibratedCamera) -> f64 {
    camera.depth_rms_mm.expect("depth")
}

/// Each camera's field is as smooth as its own frames want it: that of the camera with the error takes it up as it does in a fit
/// of this camera alone, that of the other stays flat.
#[test]
fn every_camera_has_a_field_as_smooth_as_its_frames_want() {
    let capture = capture(24);
    let options = with_field(None, "bspline");
    let fit = calibrate(&capture, &options).expect("a calibration");
    let without = calibrate(&capture, &CalibrateOptions::default()).expect("a calibration");
    let [first, second] = [0, 1].map(|i| &fit.cameras[i].calibrated);
    let alone = calibrate_camera(&capture.cameras[0].capture, &options.of_only(&capture.cameras[0])).expect("a fit");
    // With the poses that both cameras see, held-out frames want a field of a fifth of the roughness.
    let ratio = depth_rms_mm(first) / depth_rms_mm(&alone);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    assert!(depth_rms_mm(first) < 0.9 * depth_rms_mm(&without.cameras[0].calibrated));
    let effective = [first, second].map(|camera| camera.smoothness.fields[0].effective.expect("it was chosen"));
    assert!(effective[0] > 1.5 * effective[1], "{effective:?}");
    assert!(first.smoothness.fields[0].roughness > second.smoothness.fields[0].roughness, "{effective:?}");
}

/// A field of so many nodes that they are variables of their own: its covariance is out of reach, which the file says by having
/// none.
#[test]
fn a_field_of_very_many_nodes_is_adjusted_in_a_rig() {
    let capture = capture(12);
    let options = with_field(Some("infrared"), "multiplier@columns=16@rows=12@bins=3");
    let fit = calibrate(&capture, &options).expect("a calibration");
    let without = calibrate(&capture, &CalibrateOptions::default()).expect("a calibration");
    assert!(depth_rms_mm(&fit.cameras[0].calibrated) < 0.9 * depth_rms_mm(&without.cameras[0].calibrated));
    assert!(fit.covariance.is_none());
    let read = written(&fit);
    let read_cameras = cameras_from_record(&read, &Register::builtin()).expect("cameras");
    let off = read_cameras[1].camera_from_rig.inverse() * fit.cameras[1].camera_from_rig;
    assert!(off.rotation.angle() < 1e-12 && off.translation.vector.norm() < 1e-9, "{off}");
    assert_eq!((&read.covariance, &read.others[0].camera_from_rig.std_dev), (&None, &None));
}

/// The file of a fit, read again.
fn written(fit: &Calibrated) -> Calibration {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("calibration.json");
    let reference = FileReference { path: "captures".into(), digest: "0".repeat(64) };
    calibration_record(fit, &evaluate_fitted(fit), reference, None).write(&path).expect("a file");
    Calibration::read(&path).expect("a calibration")
}

/// A diagnosis may find a function of its own for every camera, and gives them names by their covariates alone.
#[test]
fn two_cameras_have_different_formulas_of_one_name() {
    let capture = capture(8);
    let mut options = with_field(None, "bent");
    for (camera, formula) in [("infrared", "a * u"), ("infrared2", "a * v")] {
        let text = format!(
            "[[effect]]\nname = \"bent\"\nhook = \"depth\"\nadds_to = \"depth\"\nof = \"measured\"\n\
             formula = \"{formula}\"\nparameters = {{ a = \"mm/px\" }}\n"
        );
        let mut register = Register::builtin();
        FormulaFile::parse(&text).expect("a formula").effects()[0].register(&mut register).expect("a new name");
        options.registers.insert(camera.to_owned(), register);
    }
    let read = written(&calibrate(&capture, &options).expect("a calibration"));
    let formulas: Vec<String> = read
        .cameras()
        .filter_map(|camera| camera.pieces.iter().find_map(|piece| piece.formula.as_ref()))
        .map(|formula| formula.formula.texts().join(", "))
        .collect();
    assert_eq!(formulas, ["a * u", "a * v"]);
    let cameras = cameras_from_record(&read, &Register::builtin()).expect("cameras");
    assert!(cameras.iter().all(|placed| placed.camera.block("bent").is_some()));
}

/// While a field is flat, poses take up what it explains, and held-out frames want it rough; with the right poses, frames that
/// the others do not determine spoke for a flat one again, and the fit ended wherever the rounds did: flat after six, rough after
/// twenty, with markers 1.8 times as noisy as they are (0.05 px) or not.
#[test]
fn the_smoothness_of_a_field_does_not_go_round_in_a_circle() {
    let capture = capture(24);
    let options = with_field(None, "bspline").of_only(&capture.cameras[0]);
    for (rounds, first_roughness) in [(6, 0.3), (12, 3.0)] {
        let mut options = CameraOptions { smoothness_rounds: rounds, ..options.clone() };
        options.field_thresholds.first_roughness = first_roughness;
        let fit = calibrate_camera(&capture.cameras[0].capture, &options).expect("a fit");
        assert!(fit.noise.pixel_sigma < 0.055, "{rounds} {first_roughness}: {} px", fit.noise.pixel_sigma);
        assert!(fit.smoothness.fields[0].effective.expect("it was chosen") > 10.0, "{:?}", fit.smoothness);
    }
}
