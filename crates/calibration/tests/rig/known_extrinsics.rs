//! A depth camera without images whose extrinsics are known, and whose depth has an effect that depthcal does not have.

use crate::support;
use depthcal_calibration::calibrate::{CalibrateError, CalibrateOptions, calibrate};
use depthcal_calibration::diagnose::{DiagnoseOptions, diagnose};
use depthcal_calibration::rig_simulated::{pose, rig_capture};
use depthcal_formula::FormulaFile;
use depthcal_simulate::{Kind, PointOptions, RigSimulation};

const SADDLE: &str = "[[effect]]\nname = \"saddle\"\nhook = \"depth\"\nadds_to = \"depth\"\nof = \"measured\"\n\
                      formula = \"a * (u - u0) * (v - v0)\"\nparameters = { a = \"mm/px^2\" }\n\
                      constants = { u0 = 256, v0 = 212 }\n";

#[test]
fn a_third_kind_of_camera_is_calibrated_and_diagnosed() {
    let rig = RigSimulation::new(vec![support::infrared(), support::depth_only()], Kind::General(1), 5);
    let points = rig.observe_points(&PointOptions::default()).expect("a simulation");
    let mut capture = rig_capture(&points);
    let known = pose(&points.truth.cameras[1].camera_from_rig);
    capture.cameras[1].camera_from_rig = Some(known);
    for pixel in capture.cameras[1].capture.frames.iter_mut().flat_map(|frame| frame.raw.depth_pixels_mut()) {
        let [u, v] = pixel.context.pixel;
        pixel.depth_mm += 3e-4 * (u - 256.0) * (v - 212.0);
    }
    let mut options = CalibrateOptions::default();
    FormulaFile::parse(SADDLE).unwrap().effects()[0].register(&mut options.each.register).expect("a new name");
    let fit = calibrate(&capture, &options).expect("a calibration");
    let depth = fit.camera("depth").expect("the camera");
    assert_eq!((depth.camera_from_rig, depth.place_std_dev), (known, Some([0.0; 6])));
    let names = fit.parameters();
    let row = |name: &str| names.iter().position(|(n, _)| n == name).expect("a parameter");
    assert!(fit.std_dev(row("depth/camera_from_rig.tx")) == 0.0);
    assert!(fit.std_dev(row("depth/pinhole.fx")) > 0.0);
    let options = DiagnoseOptions { calibrate: options, formulas: false, ..DiagnoseOptions::default() };
    let diagnosis = diagnose(&capture, None, &options).expect("a diagnosis");
    let effects: Vec<(&str, Vec<&str>)> =
        diagnosis.cameras.iter().map(|c| (&*c.name, c.effects().iter().map(|e| e.name.as_str()).collect())).collect();
    assert_eq!(effects, [("infrared", vec![]), ("depth", vec!["saddle"])]);
    let rig = diagnosis.rig.expect("several cameras");
    assert_eq!(rig.last.camera("depth").expect("the camera").camera_from_rig, known);
}

/// Extrinsics that are declared as known and are 50 mm wrong along the optical axis, a sixteenth of the boards' distance, are
/// refused, by noise or by focal length.
#[test]
fn wrong_known_extrinsics_are_refused() {
    let rig = RigSimulation::new(vec![support::infrared(), support::colour()], Kind::General(1), 6);
    let points = rig.observe_points(&PointOptions::default()).expect("a simulation");
    let mut capture = rig_capture(&points);
    let mut known = pose(&points.truth.cameras[1].camera_from_rig);
    capture.cameras[1].camera_from_rig = Some(known);
    calibrate(&capture, &CalibrateOptions::default()).expect("a calibration with the true extrinsics");
    known.translation.vector.z += 50.0;
    capture.cameras[1].camera_from_rig = Some(known);
    let error = calibrate(&capture, &CalibrateOptions::default()).map(|_| ()).unwrap_err();
    assert!(matches!(error, CalibrateError::RigContradiction(_)), "{error}");
    assert!(error.is_untrusted_fit() && error.to_string().contains("known"), "{error}");
}
