//! The search on captures without any effect.

use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use depthcal_statistics::upper_median;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use super::*;
use crate::calibrate::{CalibrateOptions, calibrate};
use crate::simulated;

/// The terms' scores of a capture without effects, in which every frame has a plane of its own of about so many mm.
fn screened(seed: u64, planes_mm: f64) -> Vec<screening::Screened> {
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
    let options = CalibrateOptions { frame_planes: false, ..CalibrateOptions::default() };
    let fit = calibrate(&capture, &options).unwrap();
    screen(&Observations::of(&fit).unwrap())
}

/// The parts of a term's score by frame have the variance that its information says.
#[test]
fn scores_of_frames_have_the_variance_of_noise() {
    for seed in [4, 5] {
        let over_information = |s: &screening::Screened| {
            let of_frame = |frame: usize| s.statistic(|other| f64::from(u8::from(other == frame)));
            (0..s.parts.len()).map(of_frame).sum::<f64>() / s.term.columns() as f64
        };
        let median = upper_median(&mut screened(seed, 0.0).iter().map(over_information).collect::<Vec<_>>()).unwrap();
        // 27 frames give a variance within a third, and the fit takes some of it up.
        assert!((0.75..1.33).contains(&median), "{median}");
    }
}

/// Without any effect p-values are spread over 0 … 1, even where frames have errors of their own a hundred times the noise of the terms.
#[test]
fn p_values_are_those_of_chance() {
    for planes_mm in [0.0, 2.0] {
        let mut p_values: Vec<f64> = (0..8).map(|seed| p_value(&screened(seed, planes_mm))).collect();
        let median = upper_median(&mut p_values).unwrap();
        let least = p_values.iter().copied().fold(1.0, f64::min);
        // Of eight uniform values the least is below 0.005 in 4 % of cases, and the fifth outside of these bounds in 1 %.
        assert!(least > 0.005 && (0.1..0.97).contains(&median), "{planes_mm} mm: {p_values:?}");
    }
}
