//! Lenses other than the default, and their choice, on simulated markers and depth.

use depthcal_model::hook::{Lens, LensState};
use depthcal_model::{Context, ModelSpec, Parameter, Piece, Register, Role, Scalar};
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

use super::*;
use crate::judge::camera::evaluate_camera;
use crate::observe::CameraFrames;
use crate::simulated;
use crate::start::{FrameMarkers, start_camera};

fn captured(camera: CameraTruth, kind: Kind, seed: u64) -> CameraFrames {
    let options = PointOptions { depth_samples: 300, ..PointOptions::default() };
    simulated::capture(&Simulation::new(camera, kind, &[], seed).observe_points(&options).unwrap())
}

fn options(lens: &str) -> CameraOptions {
    CameraOptions { lens: lens.to_owned(), ..CameraOptions::default() }
}

/// Start values of a camera of 150°: the focal length is near enough for an adjustment, with every lens that describes such a
/// camera.
#[test]
fn a_fisheye_camera_has_start_values() {
    let truth = CameraTruth::fisheye_150();
    let capture = captured(truth, Kind::General(1), 3);
    let frames: Vec<FrameMarkers<'_>> =
        capture.frames.iter().map(|f| FrameMarkers { name: &f.name, markers: &f.markers }).collect();
    let widest = frames.iter().flat_map(|f| f.markers).map(|m| (m.pixel[0] - 400.0).abs()).fold(0.0, f64::max);
    assert!(widest > 340.0, "markers reach only {widest} px from the middle");
    for lens in ["kannala-brandt", "opencv8", "division", "unified"] {
        let camera =
            start_camera(&capture.target, 800, 500, &frames, lens, &depthcal_model::Register::builtin()).unwrap();
        // 60° off axis.
        let [u, _] = camera.project(&nalgebra::Vector3::new(3.0_f64.sqrt(), 0.0, 1.0)).unwrap();
        let angle = 60.0_f64.to_radians();
        let expected = 299.5 * (angle + 0.021 * angle.powi(3) - 0.009 * angle.powi(5) + 0.0024 * angle.powi(7));
        assert!((u - 399.5 - expected).abs() < 25.0, "{lens}: {u}");
    }
}

#[test]
fn a_fisheye_camera_is_calibrated() {
    let truth = CameraTruth::fisheye_150();
    let (capture, other) = (captured(truth, Kind::General(1), 3), captured(truth, Kind::General(2), 4));
    let result = calibrate_camera(&capture, &options("kannala-brandt")).unwrap();
    let [fx, fy, cx, cy, _] = result.camera.pinhole();
    println!("fx {fx:.3} fy {fy:.3} cx {cx:.3} cy {cy:.3}, {:.4} px", result.reprojection_rms_px);
    assert!((fx - truth.focal_px[0]).abs() < 0.3 && (fy - truth.focal_px[1]).abs() < 0.3, "{fx} {fy}");
    // Noise of 0.05 px per coordinate.
    assert!(result.reprojection_rms_px < 0.075, "{} px", result.reprojection_rms_px);
    let mut oracle = result.camera.clone();
    let theta: Vec<f64> = truth
        .fisheye
        .unwrap()
        .into_iter()
        .chain([truth.focal_px[0], truth.focal_px[1], truth.centre_px[0], truth.centre_px[1], 0.0])
        .chain(truth.depth)
        .collect();
    oracle = oracle.with_theta(&theta);
    let depth = |camera: &depthcal_model::Camera| evaluate_camera(camera, &other).record().depth_rms_mm.unwrap();
    let (fitted, best) = (depth(&result.camera), depth(&oracle));
    println!(
        "depth: {:.3} mm before, {:.3} mm after, {:.3} mm with the true camera",
        fitted.before, fitted.after, best.after
    );
    assert!(fitted.after < 1.05 * best.after, "{} mm, {} mm with the true camera", fitted.after, best.after);
}

/// The lens that made the captures is chosen, or none where there is none.
#[test]
fn the_lens_of_the_camera_is_chosen() {
    let ideal = CameraTruth { lens: [0.0; 5], ..CameraTruth::published(1).unwrap() };
    let cases = [
        (ideal, "none"),
        (CameraTruth::published(1).unwrap(), "brown-conrady"),
        (CameraTruth::fisheye_150(), "kannala-brandt"),
    ];
    for (truth, expected) in cases {
        let capture = captured(truth, Kind::General(1), 5);
        let fit = calibrate_image(&capture, &CameraOptions { model: ModelSpec::none(), ..options(AUTO) }).unwrap();
        let comparison = fit.lens_comparison.clone().unwrap();
        println!("{comparison:#?}");
        assert_eq!(comparison.chosen, expected, "{comparison:#?}");
        assert_eq!(comparison.lenses.len(), crate::start::LENS_MODELS.len());
        let chosen = comparison.lenses.iter().find(|lens| lens.lens == expected).unwrap();
        // Noise of 0.05 px per coordinate.
        assert!(chosen.held_out_px.unwrap() < 0.08, "{chosen:?}");
        let free: usize = fit
            .camera
            .blocks()
            .iter()
            .filter(|b| b.piece().is_some())
            .map(|b| b.free.iter().filter(|f| **f).count())
            .sum();
        assert_eq!(free, chosen.parameters);
    }
}

/// A lens that depthcal does not have, with a parameter that no lens of its own needs for these captures.
#[derive(Debug)]
struct Quartic;

impl Piece<Lens, 1> for Quartic {
    const NAME: &'static str = "quartic";
    const SUMMARY: &'static str = "the lens distorts with the fourth power of the radius";
    const EQUATION: &'static str = "(x, y) (1 + q r⁴)";
    const SOURCE: &'static str = "a test";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("q", "1", 0.0, 0.1)];
    const ROLE: Role = Role::Model;

    fn map<T: Scalar>(&self, s: LensState<T>, [q]: [T; 1], _: &Context) -> [T; 2] {
        let r2 = s.x * s.x + s.y * s.y;
        let scale = q * r2 * r2 + 1.0;
        [s.x * scale, s.y * scale]
    }
}

/// A lens of a program is asked for by its name, and is compared with depthcal's own.
#[test]
fn a_lens_of_a_program_is_one_of_those_that_are_compared() {
    let truth = CameraTruth { lens: [0.0, -0.4, 0.0, 0.0, 0.0], ..CameraTruth::published(1).unwrap() };
    let capture = captured(truth, Kind::General(1), 5);
    let mut register = Register::builtin();
    register.add::<Lens, 1, Quartic>(|_| Quartic);
    let given = |lens: &str| CameraOptions { register: register.clone(), model: ModelSpec::none(), ..options(lens) };
    let asked = calibrate_image(&capture, &given("quartic")).unwrap();
    assert!((asked.camera.block("quartic").unwrap().theta[0] + 0.4).abs() < 0.02, "{:?}", asked.camera.theta());
    let chosen = calibrate_image(&capture, &given(AUTO)).unwrap();
    let comparison = chosen.lens_comparison.as_ref().unwrap();
    assert_eq!((comparison.chosen.as_str(), comparison.lenses.len()), ("quartic", 8), "{comparison:#?}");
}
