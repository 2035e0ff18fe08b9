//! Rigs whose board is bent. There is one board: what one camera shows of it, the others know, whether or not they have images.

use depthcal_calibration::calibrate::CalibrateOptions;
use depthcal_calibration::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use depthcal_calibration::rig_simulated::rig_capture;
use depthcal_simulate::{Effect, Kind, PointOptions, RigCamera, RigSimulation, RigTruth};

use crate::support;

/// The diagnosis of a rig whose board is bent by 2.5 mm, and the truth.
fn diagnosed(cameras: Vec<RigCamera>, seed: u64) -> (Diagnosis, RigTruth) {
    let bow = Effect::new("board_bow", 2.5).expect("an effect");
    let rig = RigSimulation::new(cameras, Kind::General(1), seed).frames(20).board_effect(bow);
    let points = rig.observe_points(&PointOptions::default()).expect("a simulation");
    let calibrate = CalibrateOptions { lens: None, ..CalibrateOptions::default() };
    let options = DiagnoseOptions { calibrate, formulas: false, ..DiagnoseOptions::default() };
    let diagnosis = diagnose(&rig_capture(&points), None, &options).expect("a diagnosis");
    (diagnosis, points.truth)
}

/// Names of the effects that a camera's own loop added, and of those that it was given.
fn effects<'a>(diagnosis: &'a Diagnosis, camera: &str) -> [Vec<&'a str>; 2] {
    let camera = diagnosis.camera(camera).expect("the camera");
    let steps = camera.diagnosis.steps.iter().map(|step| step.spec.name.as_str()).collect();
    let given = camera.in_rig.as_ref().expect("a rig").of_board.iter().map(|spec| spec.name.as_str()).collect();
    [steps, given]
}

/// Poses by images alone follow the bend by degrees: frames of the depth camera were dropped for it, and its place was
/// centimetres off where it was found at all.
#[test]
fn a_camera_without_images_has_the_board_of_the_others() {
    for seed in [1, 2] {
        let (diagnosis, truth) = diagnosed(vec![support::infrared(), support::depth_only()], seed);
        assert_eq!(effects(&diagnosis, "infrared"), [vec!["board_bow"], vec![]], "seed {seed}");
        assert_eq!(effects(&diagnosis, "depth"), [vec![], vec!["board_bow"]], "seed {seed}");
        let last = &diagnosis.rig.as_ref().expect("a rig").last;
        let depth = last.camera("depth").expect("the camera");
        let (fitted, place) = (&depth.calibrated.camera, depth.camera_from_rig.translation);
        let of_infrared = &last.cameras[0].calibrated.camera;
        let bow = |camera: &depthcal_model::Camera| {
            camera.block("board_bow").map(|b| (b.theta.clone(), b.constants_in_words()))
        };
        assert!(bow(fitted).is_some() && bow(fitted) == bow(of_infrared), "there is one board");
        assert_eq!(depth.calibrated.capture.frames.len(), 20, "seed {seed}: frames were dropped");
        let std_devs = depth.place_std_dev.expect("a place that is fitted");
        for (i, expected) in truth.cameras[1].camera_from_rig.translation.iter().enumerate() {
            let error = place.vector[i] - expected;
            assert!(error.abs() < 4.0 * std_devs[3 + i] && error.abs() < 5.0, "seed {seed}, axis {i}: {error} mm");
        }
    }
}

/// Whichever of two cameras with images shows the bend first: the effect is one of the board, and of neither camera.
#[test]
fn two_cameras_with_images_have_one_board() {
    let second = RigCamera::usual("infrared2", 1).expect("camera 2").expect("a usual camera");
    let (diagnosis, _) = diagnosed(vec![support::infrared(), second], 3);
    let [first, second] = ["infrared", "infrared2"].map(|camera| effects(&diagnosis, camera));
    assert_eq!((first, second), ([vec!["board_bow"], vec![]], [vec![], vec!["board_bow"]]));
}
