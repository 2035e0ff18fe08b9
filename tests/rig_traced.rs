//! Rendered rigs with an effect of one camera that is not declared: the diagnosis names this camera and this effect, and nothing
//! else.
#![cfg(feature = "detect")]

use depthcal::Register;
use depthcal::calibration::diagnose::{DiagnoseOptions, DiagnosedCamera, Diagnosis, RigDiagnosis, diagnose};
use depthcal::calibration::load::{LoadOptions, load};
use depthcal_simulate::{Effect, Kind, RigCamera, RigSimulation};

const FRAMES: usize = 20;

/// Renders the cameras, one of which has the effect, and diagnoses their images.
fn diagnosed(cameras: [&str; 2], afflicted: &str, (effect, size_mm): (&str, f64), seed: u64) -> Diagnosis {
    let camera = |name: &str| {
        let camera = RigCamera::usual(name, 1).unwrap().unwrap();
        if name == afflicted { camera.effect(Effect::new(effect, size_mm).unwrap()) } else { camera }
    };
    let folder = tempfile::tempdir().unwrap();
    let captures = folder.path().join("rig");
    let rig = RigSimulation::new(cameras.map(camera).to_vec(), Kind::General(1), seed).frames(FRAMES);
    rig.write_dataset(&captures).unwrap();
    let rig = load(&captures, &LoadOptions { cache: None, ..LoadOptions::default() }).unwrap();
    let options = DiagnoseOptions { formulas: false, ..DiagnoseOptions::default() };
    diagnose(&rig.capture(None, &Register::builtin()).unwrap(), None, &options).unwrap()
}

/// The findings on all cameras together.
fn rig(diagnosis: &Diagnosis) -> &RigDiagnosis {
    diagnosis.rig.as_ref().unwrap()
}

/// Effects that were added, `CAMERA:EFFECT`.
fn added(diagnosis: &Diagnosis) -> Vec<String> {
    let names = |camera: &DiagnosedCamera| {
        camera.effects().iter().map(|effect| format!("{}:{}", camera.name, effect.name)).collect::<Vec<_>>()
    };
    diagnosis.cameras.iter().flat_map(names).collect()
}

#[test]
fn of_the_infrared_camera_next_to_a_colour_camera() {
    let diagnosis = diagnosed(["infrared", "colour"], "infrared", ("radial_range", 6.0), 11);
    assert_eq!(added(&diagnosis), ["infrared:radial_range"]);
}

/// Its pinhole and its place come from its depth alone and have taken up most of the effect: the principal point is some 16 px
/// off. A fit with the effect brings them back.
#[test]
fn of_depth_without_images() {
    let diagnosis = diagnosed(["infrared", "depth"], "depth", ("cyclic_depth", 4.0), 12);
    assert_eq!(added(&diagnosis), ["depth:cyclic_depth"]);
    let camera = rig(&diagnosis).last.camera("depth").unwrap();
    let (fitted, std_devs) = (camera.calibrated.camera.pinhole(), camera.calibrated.std_devs());
    let truth = [365.4, 365.9, 258.6, 208.2];
    for i in 0..4 {
        // After the five coefficients of the lens.
        let sigma = std_devs[5 + i].unwrap();
        assert!((fitted[i] - truth[i]).abs() < 4.0 * sigma, "{i}: {} ± {sigma}, not {}", fitted[i], truth[i]);
    }
    let shown = &diagnosis.camera("depth").unwrap().in_rig.as_ref().unwrap().before[0];
    assert!(shown.left_out.after < 0.8 * shown.left_out.before, "{shown:?}");
}

#[test]
fn of_the_second_of_two_infrared_cameras() {
    let diagnosis = diagnosed(["infrared", "infrared2"], "infrared2", ("incidence_bias", 5.0), 13);
    assert_eq!(added(&diagnosis), ["infrared2:incidence_bias"]);
}
