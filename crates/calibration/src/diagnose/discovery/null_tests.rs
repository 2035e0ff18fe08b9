//! The search on captures without any effect.

use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use depthcal_statistics::upper_median;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use super::*;
use crate::calibrate::{CameraOptions, calibrate_camera};
use crate::simulated;

/// The rows of a capture without effects, in which every frame has a plane of its own of about so many mm.
fn observations(seed: u64, planes_mm: f64) -> Observations {
    let camera = CameraTruth::published(1 + (seed % 4) as usize).unwrap();
    let simulation = Simulation::new(camera, Kind::General(1), &[], 200 + seed).unit(seed);
    let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
    let mut random = StdRng::seed_from_u64(seed);
    for frame in &mut capture.frames {
        let [a, b, c] = [1.0, 0.005, 0.005].map(|size| size * planes_mm * random.sample::<f64, _>(StandardNormal));
        for pixel in frame.raw.depth_pixels_mut() {
            let [u, v] = pixel.context.pixel;
            pixel.depth_mm += a + b * (u - camera.centre_px[0]) + c * (v - camera.centre_px[1]);
        }
    }
    let options = CameraOptions { frame_planes: false, ..CameraOptions::default() };
    let fit = calibrate_camera(&capture, &options).unwrap();
    Observations::of(&fit).unwrap()
}

/// Terms that are screened together have the scores that each has alone.
#[test]
fn scores_of_the_library_are_those_of_its_terms() {
    let observations = observations(3, 1.0);
    let screened = screen(&observations);
    assert!(screened.len() > 5000, "{}", screened.len());
    let mut kinds = std::collections::BTreeSet::new();
    // A prime number, so that terms of all places, forms and covariates are among them.
    for together in screened.iter().step_by(37) {
        kinds.insert(together.term.families());
        let alone = Screened::of(&observations, &together.term, together.parts.len()).unwrap();
        for part in 0..together.parts.len() {
            let of_part = |s: &Screened| s.statistic(|other| f64::from(u8::from(other == part)));
            let (a, b) = (of_part(together), of_part(&alone));
            // Columns of which the shared ones leave a ten-thousandth lose four more digits.
            assert!((a - b).abs() < 1e-6 * (1.0 + b.abs()), "{:?}: {a} {b}", together.term);
        }
    }
    assert!(kinds.len() > 20, "{kinds:?}");
}

/// The parts of a term's score by frame have the variance that its information says.
#[test]
fn scores_of_frames_have_the_variance_of_noise() {
    let over_information = |s: &Screened| {
        let of_frame = |frame: usize| s.statistic(|other| f64::from(u8::from(other == frame)));
        (0..s.parts.len()).map(of_frame).sum::<f64>() / s.term.columns() as f64
    };
    let of_capture = |seed| {
        let screened = screen(&observations(seed, 0.0));
        screened.iter().map(over_information).sum::<f64>() / screened.len() as f64
    };
    let means: Vec<f64> = (0..4).map(of_capture).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    // The terms of a capture resemble each other: each mean is as uncertain as the variance of some 27 numbers, a quarter.
    assert!((0.75..1.25).contains(&mean), "{means:?}");
}

/// Without any effect p-values are spread over 0 … 1. Where frames have planes of their own that are far beyond the noise they
/// are smaller, but not below the level at which a formula is accepted.
#[test]
fn p_values_are_those_of_chance() {
    let level = Thresholds::default().level;
    let p_value_of = |seed, planes_mm| p_value(&screen(&observations(seed, planes_mm)), None);
    let p_values = |planes_mm| (0..8).map(|seed| p_value_of(seed, planes_mm)).collect::<Vec<f64>>();
    let mut clean = p_values(0.0);
    let median = upper_median(&mut clean).unwrap();
    // The fifth of eight uniform values is outside of these bounds in 1 % of cases.
    assert!((0.1..0.97).contains(&median), "{clean:?}");
    let with_planes = p_values(2.0);
    let least = clean.iter().chain(&with_planes).copied().fold(1.0, f64::min);
    assert!(least > level, "{clean:?} {with_planes:?}");
}

/// Without any effect p-values of smooth functions, of one covariate and of two, are spread over 0 … 1, and with planes of frames
/// they are not below half of the level.
#[test]
fn p_values_of_smooth_functions_are_those_of_chance() {
    let p_value_of = |seed, planes_mm| which_covariates(&observations(seed, planes_mm)).map_or(1.0, |set| set.p_value);
    let p_values = |planes_mm| (0..8).map(|seed| p_value_of(seed, planes_mm)).collect::<Vec<f64>>();
    let mut clean = p_values(0.0);
    let median = upper_median(&mut clean).unwrap();
    assert!((0.1..=1.0).contains(&median), "{clean:?}");
    let with_planes = p_values(2.0);
    let least = clean.iter().chain(&with_planes).copied().fold(1.0, f64::min);
    assert!(least > 0.5 * Thresholds::default().level, "{clean:?} {with_planes:?}");
}
