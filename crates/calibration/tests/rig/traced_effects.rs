//! Rigs with an effect on one camera that is not declared: the diagnosis names this camera and this effect, and no other camera
//! has any.

use crate::support;
use depthcal_calibration::calibrate::CalibrateOptions;
use depthcal_calibration::calibration_record::calibration_record;
use depthcal_calibration::camera_record::cameras_from_record;
use depthcal_calibration::diagnose::{DiagnoseError, DiagnoseOptions, Diagnosis, RigDiagnosis, diagnose};
use depthcal_calibration::rig_simulated::rig_capture;
use depthcal_io::{Calibration, DriftOver, FileReference};
use depthcal_model::Register;
use depthcal_simulate::{Drift, Effect, Kind, PointOptions, RigCamera, RigSimulation};
use depthcal_statistics::rms;

fn diagnosed(cameras: Vec<RigCamera>, seed: u64) -> Diagnosis {
    let rig = RigSimulation::new(cameras, Kind::General(1), seed);
    let points = rig.observe_points(&PointOptions::default()).expect("a simulation");
    let rig = CalibrateOptions { lens: None, ..CalibrateOptions::default() };
    let options = DiagnoseOptions { calibrate: rig, formulas: false, ..DiagnoseOptions::default() };
    diagnose(&rig_capture(&points), None, &options).expect("a diagnosis")
}

/// The findings on all cameras together.
fn rig(diagnosis: &Diagnosis) -> &RigDiagnosis {
    diagnosis.rig.as_ref().expect("several cameras")
}

/// Names of the effects that were added to a camera.
fn added(found: &Diagnosis, camera: &str) -> Vec<String> {
    let camera = found.camera(camera).expect("the camera");
    camera.effects().iter().map(|effect| effect.name.clone()).collect()
}

fn effect(name: &str, size: f64) -> Effect {
    Effect::new(name, size).expect("an effect")
}

/// Transfer errors of the rig, mm.
fn transfer(errors: &depthcal_calibration::judge::evaluate::Evaluated) -> f64 {
    rms(errors.transfers.iter().flat_map(|t| t.points.iter().map(|p| p.error_mm)))
}

#[test]
fn an_effect_of_the_reference_is_traced_to_it() {
    let diagnosis = diagnosed(vec![support::infrared().effect(effect("radial_range", 6.0)), support::colour()], 3);
    assert_eq!(added(&diagnosis, "infrared"), ["radial_range"]);
    assert_eq!(rig(&diagnosis).without_depth, ["colour"]);
    let fitted = &rig(&diagnosis).last.camera("infrared").expect("the camera").calibrated.camera;
    assert!(fitted.block("radial_range").is_some());
    assert!(
        rig(&diagnosis).last.camera("colour").expect("the camera").calibrated.camera.block("radial_range").is_none()
    );
    let (before, after) = (transfer(&rig(&diagnosis).before), transfer(&rig(&diagnosis).after));
    assert!(after < before, "{before} mm before, {after} mm after");
}

#[test]
fn an_effect_of_the_second_depth_camera_is_traced_to_it() {
    let second = RigCamera::usual("infrared2", 1).expect("camera 2").expect("a usual camera");
    let diagnosis = diagnosed(vec![support::infrared(), second.effect(effect("cyclic_depth", 4.0))], 4);
    assert_eq!(added(&diagnosis, "infrared"), [""; 0]);
    assert_eq!(added(&diagnosis, "infrared2"), ["cyclic_depth"]);
    assert!(transfer(&rig(&diagnosis).after) < transfer(&rig(&diagnosis).before));
}

/// Its board has the poses of the infrared camera.
#[test]
fn an_effect_of_depth_without_images_is_traced_to_it() {
    let diagnosis = diagnosed(vec![support::infrared(), support::depth_only().effect(effect("cyclic_depth", 6.0))], 5);
    assert_eq!(added(&diagnosis, "infrared"), [""; 0]);
    assert_eq!(added(&diagnosis, "depth"), ["cyclic_depth"]);
    let in_rig = diagnosis.camera("depth").and_then(|camera| camera.in_rig.as_ref()).expect("the camera");
    assert!(in_rig.poses_from_others);
    // Pinhole and place take up a part of the effect while they are held: it is tried with these free.
    let errors = in_rig.before[0].left_out;
    assert!(errors.after < 0.95 * errors.before && errors.after < 1.05, "{errors:?}");
}

#[test]
fn a_rig_without_depth_is_refused() {
    let rig = RigSimulation::new(
        vec![RigCamera { streams: depthcal_simulate::Streams::Colour, ..support::infrared() }, support::colour()],
        Kind::General(1),
        3,
    );
    let points = rig.observe_points(&PointOptions::default()).unwrap();
    let refused = diagnose(&rig_capture(&points), None, &DiagnoseOptions::default()).err().unwrap();
    assert!(matches!(refused, DiagnoseError::NoDepth { .. }) && refused.to_string().contains("depth"), "{refused}");
}

/// A camera that turns on the rig as time passes: no camera lacks an effect, the place does, and transfer errors fall to those of
/// a rig that keeps still.
#[test]
fn a_place_that_drifts_is_told_from_one_that_keeps_still() {
    let drift = Drift::Time { rotation_rad: [0.0, 0.003, 0.0], translation_mm: [0.8, 0.0, 0.0] };
    let diagnosis = diagnosed(vec![support::infrared(), support::colour().drift(drift)], 6);
    let (place, _) = rig(&diagnosis).last.camera("colour").expect("the camera").drift.expect("a drift");
    assert_eq!(place.over, DriftOver::Time);
    // Between the first and the last frame, over the rig's axes; the camera's differ by some hundredths.
    assert!((place.change[1] - 0.003).abs() < 3e-4 && (place.change[3] - 0.8).abs() < 0.2, "{place:?}");
    assert!(transfer(&rig(&diagnosis).after) < 0.7 * transfer(&rig(&diagnosis).before));
    // The file has the drift, with the covariance of its parameters.
    let reference = FileReference { path: "captures".into(), digest: "0".repeat(64) };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration.json");
    calibration_record(&rig(&diagnosis).last, &rig(&diagnosis).fitted, reference, None).write(&path).unwrap();
    let read = Calibration::read(&path).unwrap();
    assert_eq!(cameras_from_record(&read, &Register::builtin()).unwrap()[1].drift, Some(place));
    let name = "colour/extrinsics_drift.ry";
    let variance = read.covariance.as_ref().and_then(|c| c.get(name, name)).expect("a variance");
    let std_dev = read.others[0].camera_from_rig.drift.and_then(|d| d.std_dev).expect("standard deviations");
    assert!((variance.sqrt() / std_dev.rotation_rad[1] - 1.0).abs() < 1e-9);
    let still = diagnosed(vec![support::infrared(), support::colour()], 7);
    assert!(rig(&still).drifts.iter().all(|test| !test.certain), "{:?}", rig(&still).drifts);
    assert!(rig(&still).last.cameras.iter().all(|camera| camera.drift.is_none()));
}
