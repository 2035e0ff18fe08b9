//! A depth camera whose image cannot be had, on a rig with one that has infrared images.

use crate::support;
use depthcal_calibration::calibrate::CalibrateError;
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::judge::capture_cross_validation::cross_validate;
use depthcal_calibration::judge::evaluate::evaluate;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::rig_simulated::{errors, rig_capture};
use depthcal_model::Camera;
use depthcal_simulate::{Kind, PointOptions, Pose, RigPoints, RigSimulation};

fn observed(seed: u64) -> RigPoints {
    let rig = RigSimulation::new(vec![support::infrared(), support::depth_only()], Kind::General(1), seed);
    rig.observe_points(&PointOptions::default()).expect("a simulation")
}

fn options() -> CalibrateOptions {
    CalibrateOptions { lens: None, ..CalibrateOptions::default() }
}

/// Nothing is declared: K, lens, D and place come back within three of their standard deviations, which say what planes
/// determine; the parameters that they leave to the prior are named.
#[test]
fn planes_give_place_pinhole_lens_and_depth() {
    let (mut within, mut all) = (0, 0);
    for seed in 0..4 {
        let points = observed(seed);
        let fit = calibrate(&rig_capture(&points), &options()).expect("a calibration");
        let camera = fit.camera("depth").expect("the camera");
        assert!(!camera.has_markers() && camera.calibrated.with_depth);
        let names = fit.parameters();
        let errors = errors(&fit, &points.truth);
        let errors: Vec<_> = errors.iter().filter(|(i, _)| names[*i].0.starts_with("depth/")).collect();
        assert_eq!(errors.len(), 6 + 5 + 4 + 4, "seed {seed}");
        within += errors.iter().filter(|(i, e)| e.abs() <= 3.0 * fit.std_dev(*i)).count();
        all += errors.len();
        let translation = camera.camera_from_rig.translation.vector;
        assert!((translation.x + 71.5).abs() < 15.0, "seed {seed}: {translation}");
        for open in &camera.left_open {
            let is_of_image = ["pinhole.", "brown_conrady."].iter().any(|block| open.parameter.starts_with(block));
            assert!(is_of_image && open.reason.contains("prior"), "{open:?}");
        }
    }
    assert!(within as f64 >= 0.95 * all as f64, "{within} of {all} within three standard deviations");
}

/// The camera is judged where the other one's image has the board: as far off as its depth is from the true planes, which
/// correction takes to the noise; no error of the image is made up. Frames that the other camera did not see are named.
#[test]
fn its_errors_are_those_at_the_poses_of_the_other_camera() {
    let mut capture = rig_capture(&observed(1));
    let fit = calibrate(&capture, &options()).expect("a calibration");
    let gone = capture.cameras[0].capture.frames.remove(2).name.clone();
    let evaluated = evaluate(&fit.placed(), &capture);
    let names: Vec<&str> = evaluated.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["infrared", "depth"]);
    let depth = evaluated.camera("depth").expect("the camera");
    assert_eq!(depth.frames.len() + depth.dropped.len(), capture.cameras[1].capture.frames.len());
    assert!(depth.dropped.iter().any(|frame| frame.name == gone && frame.reason.contains("no other camera")));
    let record = depth.record();
    assert!(record.reprojection_px.is_none() && record.dot_error_mm.is_none());
    let rms = record.depth_rms_mm.expect("depth");
    // The same pixels at the poses of the joint adjustment, by the noise that it estimates.
    let camera = &fit.camera("depth").expect("the camera").calibrated;
    let samples = || camera.capture.frames.iter().flat_map(|frame| frame.samples.iter());
    let noise = samples().map(|s| (camera.noise.depth.sigma(1.0 / s.depth_mm) * s.depth_mm.powi(2)).powi(2));
    let noise_mm = (noise.sum::<f64>() / samples().count() as f64).sqrt();
    assert!((rms.after / noise_mm - 1.0).abs() < 0.1, "{rms:?}, noise {noise_mm} mm");
    assert!(rms.before > 1.2 * rms.after, "{rms:?}");
    // Left-out frames are hardly worse.
    let validated = cross_validate(&fit, &capture, 5, Parts::Interleaved, &options()).expect("folds");
    let left_out = validated.camera("depth").expect("the camera").record().depth_rms_mm.expect("depth");
    assert!((left_out.after / rms.after - 1.0).abs() < 0.15, "{left_out:?} {rms:?}");
}

/// Six frames determine the pinhole worse than all, and the standard deviations say so; three are refused with the reason.
#[test]
fn few_frames_say_less_and_too_few_are_refused() {
    let rig = RigSimulation::new(vec![support::infrared(), support::depth_only()], Kind::General(1), 3);
    let all = rig.observe_points(&PointOptions::default()).unwrap();
    let mut capture = rig_capture(&all);
    // The depth camera sees a few frames only.
    capture.cameras[1].capture.frames.truncate(6);
    let fit = calibrate(&capture, &options()).unwrap();
    let std_devs = fit.camera("depth").unwrap().calibrated.std_devs();
    let many = calibrate(&rig_capture(&all), &options()).unwrap();
    let precise = many.camera("depth").unwrap().calibrated.std_devs();
    assert!(std_devs[0].unwrap() > precise[0].unwrap(), "{std_devs:?} {precise:?}");
    capture.cameras[1].capture.frames.truncate(3);
    let error = calibrate(&capture, &options()).unwrap_err();
    assert!(matches!(&error, CalibrateError::DepthStart { camera, .. } if camera == "depth"), "{error}");
    assert!(error.to_string().contains("frames"), "{error}");
}

/// Boards at one distance with small tilts leave the pinhole open: with declared intrinsics the fit stays near them, and says
/// what the boards did not determine. The same boards at many distances and tilts leave nothing open.
#[test]
fn what_small_tilts_at_one_distance_leave_open_is_named() {
    let poses: Vec<Pose> = (0..14)
        .map(|i| {
            let a = f64::from(i);
            let turn = [0.12 * a.sin(), 0.12 * (1.7 * a).cos(), 0.3 * a];
            let centre = Pose::from_rotation_vector([0.0; 3], [-40.0, -85.0, 0.0]);
            let place = [60.0 * (0.9 * a).cos(), 40.0 * (1.3 * a).sin(), 800.0 + 4.0 * a];
            Pose::from_rotation_vector(turn, place).after(&centre)
        })
        .collect();
    let fit = |poses: Option<Vec<Pose>>, seed: u64| {
        let rig = RigSimulation::new(vec![support::infrared(), support::depth_only()], Kind::General(1), seed);
        let rig = poses.map_or(rig.clone(), |poses| rig.poses(poses));
        let mut capture = rig_capture(&rig.observe_points(&PointOptions::default()).unwrap());
        capture.cameras[1].declared = Some(Camera::new(512, 424, [365.0, 365.0, 258.0, 208.0, 0.0], vec![]));
        calibrate(&capture, &options()).expect("a calibration")
    };
    for seed in 0..3 {
        let narrow = fit(Some(poses.clone()), seed);
        let camera = narrow.camera("depth").expect("the camera");
        let open: Vec<&str> = camera.left_open.iter().map(|open| open.parameter.as_str()).collect();
        for parameter in ["pinhole.fx", "pinhole.fy", "pinhole.cx", "pinhole.cy"] {
            assert!(open.contains(&parameter), "seed {seed}: {parameter} is not among {open:?}");
        }
        let fx = camera.calibrated.camera.pinhole()[0];
        assert!((fx / 365.0 - 1.0).abs() < 0.06, "seed {seed}: {fx}");
        let wide = fit(None, seed);
        let open = &wide.camera("depth").expect("the camera").left_open;
        assert!(open.is_empty(), "seed {seed}: {open:?}");
    }
}
