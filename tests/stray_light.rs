//! Light that the lens spreads, from rendered frames of a camera that has it to corrected frames. The simulator sums it by code
//! of its own.

#![cfg(feature = "detect")]

use depthcal::calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, diagnose_camera};
use depthcal::calibration::judge::camera::evaluate_camera;
use depthcal::calibration::load::{LoadOptions, load};
use depthcal::calibration::observe::CameraFrames;
use depthcal::correction::{Corrector, FrameContext};
use depthcal::io::{DepthImage, GrayImage};
use depthcal_simulate::{
    Board, CameraTruth, DepthNoise, Effect, Exposure, Kind, Noise, Pattern, Rendering, Simulation,
};

/// A time-of-flight camera, which measures phases: its depth is nearly right, also of the background, whose light is summed. The
/// dark squares of the chessboard are measured.
fn simulation(effects: &[Effect]) -> Simulation {
    let whole = CameraTruth::published(1).unwrap();
    let scale = 0.75;
    let camera = CameraTruth {
        width: 480,
        height: 360,
        focal_px: whole.focal_px.map(|f| f * scale),
        centre_px: whole.centre_px.map(|c| c * scale),
        depth: [3e-6, -2e-6, 1e-6, 0.996],
        ..whole
    };
    // An infrared image of many steps, as the sum of several exposures has; its noise would hide how dark the dark squares are.
    let noise = Noise {
        depth: DepthNoise::TimeOfFlight { sigma_mm: 1.5 },
        depth_step_rho: 0.0,
        image_read: 1e-4,
        image_shot: 2e-6,
        ..Noise::default()
    };
    let board = Board { dark: 0.03, ..Board::new(Pattern::Chessboard, 7, 5, 30.0) };
    Simulation::new(camera, Kind::Longplywood1, effects, 5)
        .frames(24)
        .board(board)
        .noise(noise)
        .exposure(Exposure::Fixed { white_at_1m: 0.3 })
        .rendering(rendering())
}

fn rendering() -> Rendering {
    Rendering { image_bits: 16, max_range_mm: 4000.0, clutter: 3, wall_mm: 1700.0, ..Rendering::default() }
}

fn capture(simulation: &Simulation) -> CameraFrames {
    let folder = tempfile::tempdir().unwrap();
    simulation.write_dataset(folder.path().join("capture")).unwrap();
    load(&folder.path().join("capture"), &LoadOptions { cache: None, ..LoadOptions::default() })
        .unwrap()
        .into_only_camera()
        .unwrap()
        .capture
}

fn fit(capture: &CameraFrames, effects: &[&str]) -> CalibratedCamera {
    let effects = effects.iter().map(|e| e.parse().unwrap()).collect();
    calibrate_camera(capture, &CameraOptions { effects, ..CameraOptions::default() }).unwrap()
}

fn depth_rms_mm(fit: &CalibratedCamera, capture: &CameraFrames) -> f64 {
    evaluate_camera(&fit.camera, capture).record().depth_rms_mm.unwrap().after
}

/// A camera that modulates its light by 20 MHz instead of by the frequencies of a Kinect v2: nothing in the dataset says so.
#[test]
fn unknown_modulation_frequencies_are_found() {
    let effect = Effect::new("stray_light", 1.5).unwrap();
    let rendering = Rendering { modulation_mhz: [20.0, 0.0, 0.0], ..rendering() };
    let seen = capture(&simulation(&[effect]).rendering(rendering));
    let d = diagnose_camera(&seen, None, &CameraDiagnoseOptions::default()).unwrap();
    let step = d.steps.iter().find(|s| s.spec.name == "stray_light").unwrap();
    let told = fit(&seen, &["stray_light@f1_mhz=20"]);
    let [fitted, told] = [&d.last, &told].map(|fit| depth_rms_mm(fit, &seen));
    println!("{}: {fitted:.3} mm, with the true frequency {told:.3} mm", step.spec);
    assert_eq!(step.spec.constants.get("f1_mhz"), Some(&20.0), "{}", step.spec);
    assert!(fitted < 1.03 * told, "{fitted} mm, with the true frequency {told} mm");
}

#[test]
fn stray_light_is_recovered_and_taken_off() {
    let effect = Effect::new("stray_light", 0.6).unwrap();
    let affected = simulation(&[effect]);
    let seen = capture(&affected);
    let (without, with) = (fit(&seen, &[]), fit(&seen, &["stray_light"]));
    let truth = &affected.truth().unwrap().effects[0].parameters;
    let theta = &with.camera.block("stray_light").unwrap().theta;
    let [before, after] = [&without, &with].map(|fit| depth_rms_mm(fit, &seen));
    println!("{before:.3} → {after:.3} mm");
    let variances = with.covariance.as_ref().unwrap().diagonal();
    let first =
        with.camera.blocks().iter().take_while(|b| b.name() != "stray_light").map(|b| b.theta.len()).sum::<usize>();
    for (i, key) in ["share", "delay_rad"].into_iter().enumerate() {
        let sigma = variances[first + i].sqrt();
        let miss = (theta[i] - truth[key]).abs();
        println!("{key}: {} ± {sigma} for {}", theta[i], truth[key]);
        assert!(sigma < 0.1 * truth[key] && miss < 3.0 * sigma, "{key}: {} ± {sigma} for {}", theta[i], truth[key]);
    }

    // A camera without the effect, and the same frames without it.
    let clean = simulation(&[]);
    let unaffected = capture(&clean);
    let plain = fit(&unaffected, &["stray_light"]);
    let [kappa, b] = plain.camera.block("stray_light").unwrap().theta[..] else { panic!("two parameters") };
    assert!(kappa.abs() < 1.5e-3 && b.abs() < 5e-3, "kappa {kappa}, b {b} without the effect");
    let noise = depth_rms_mm(&plain, &unaffected);
    assert!(before > 1.3 * noise && after < 1.05 * noise, "{before} → {after} mm, noise {noise} mm");

    // The corrected frames are those of the camera without the effect, over the whole image.
    let corrector = Corrector::new(&with.camera).unwrap();
    let without = Corrector::new(&with.camera.filtered(|block| block.name() != "stray_light")).unwrap();
    assert!(corrector.has_tables() && corrector.needs().stray_light);
    let (affected, clean) = (affected.renderer().unwrap(), clean.renderer().unwrap());
    for index in [0, 7] {
        let (frame, expected) = (affected.frame(index).unwrap(), clean.frame(index).unwrap());
        let (width, height) = (frame.width, frame.height);
        let amplitude = GrayImage { width, height, data: frame.image, bits: 16 };
        let image = |data: Vec<u16>| DepthImage { width, height, data };
        let (depth, expected) = (image(frame.depth), image(expected.depth));
        let correct = |corrector: &Corrector, depth: &DepthImage| {
            let context = FrameContext { amplitude: Some((&amplitude).into()), ..FrameContext::default() };
            let mut out = vec![0.0; width * height];
            corrector.correct_u16_to_f32(depth, 0.125, &context, &mut out).unwrap();
            out
        };
        let truth = correct(&without, &expected);
        let error = |corrected: Vec<f32>| {
            let both = corrected.iter().zip(&truth).filter(|(a, b)| **a > 0.0 && **b > 0.0);
            let mut errors: Vec<f32> = both.map(|(a, b)| (a - b).abs()).collect();
            assert!(errors.len() > width * height / 2);
            errors.sort_by(f32::total_cmp);
            errors[errors.len() * 9 / 10]
        };
        let (raw, corrected) = (error(correct(&without, &depth)), error(correct(&corrector, &depth)));
        println!("frame {index}: nine in ten pixels within {raw} mm before, {corrected} mm after");
        assert!(corrected < 0.15 * raw, "frame {index}: {raw} → {corrected} mm");
    }
}
