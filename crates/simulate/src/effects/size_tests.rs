//! Every effect has its declared size, measured on a sampling of the tests' own.

use super::effect::Effect;
use super::install::install;
use super::table::{catalogue, of_whole_frames, uncatalogued};
use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::{Conditions, REFERENCE_TEMPERATURE_C};
use crate::error::SimulateError;
use crate::instrument::{Instrument, Reading};
use crate::optics::Optics;

const SIZE: f64 = 3.0;

fn camera() -> CameraTruth {
    CameraTruth { depth: [0.0, 0.0, 0.0, 1.0], ..CameraTruth::published(1).unwrap() }
}

fn with(name: &str, size: f64, unit: u64) -> Instrument {
    install(&camera(), &Board::default(), &[Effect::new(name, size).unwrap()], unit, 1).unwrap().0
}

fn when(time_s: f64, temperature_c: f64) -> Conditions {
    Conditions { frame: 0, time_s, session_s: 90.0, temperature_c }
}

/// rms over the reference volume of the change in depth between two conditions, or from nothing.
fn rms(instrument: &Instrument, now: Conditions, before: Option<Conditions>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for v in (0..480).step_by(7) {
        for u in (0..640).step_by(7) {
            let pixel = [f64::from(u), f64::from(v)];
            // The published lens folds in one corner of its image.
            let Some(ray) = instrument.optics.ray(pixel, 0.001) else { continue };
            for step in 0..40 {
                let rho = 1.0 / (410.0 + 20.0 * f64::from(step));
                let read = |conditions| Reading { pixel, ray, cosine: 0.9, amplitude: 0.5, conditions };
                let depth = |conditions| 1.0 / instrument.measure(&read(conditions), rho);
                sum += (depth(now) - before.map_or(1.0 / rho, depth)).powi(2);
                count += 1.0;
            }
        }
    }
    f64::sqrt(sum / count)
}

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((value - expected).abs() < tolerance * expected.abs(), "{what}: {value} instead of {expected}");
}

#[test]
fn rms_sizes_over_the_reference_volume() {
    let names =
        ["projector_distortion", "disparity_ripple", "quadratic_depth", "radial_range", "smooth_map", "lens_glare"];
    for unit in [0, 1, 9] {
        for name in names {
            close(rms(&with(name, SIZE, unit), when(5.0, 30.0), None), SIZE, 0.05, name);
        }
        close(rms(&with("row_banding", SIZE, unit), when(5.0, 30.0), None), SIZE, 0.15, "row_banding");
    }
}

#[test]
fn drifts_have_the_size_of_their_change() {
    for unit in [0, 4] {
        let cold = when(30.0, REFERENCE_TEMPERATURE_C);
        let settled = rms(&with("temporal_drift", SIZE, unit), when(1e5, 30.0), Some(when(0.0, 30.0)));
        close(settled, SIZE, 0.05, "temporal_drift");
        let warm = when(30.0, REFERENCE_TEMPERATURE_C + 5.0);
        close(rms(&with("temperature_drift", SIZE, unit), warm, Some(cold)), SIZE, 0.05, "temperature_drift");
    }
    let instrument = with("temporal_drift", SIZE, 0);
    let early = rms(&instrument, when(30.0, 30.0), None) / rms(&instrument, when(1e5, 30.0), None);
    close(early, 1.0 - (-1.0f64).exp(), 0.01, "a third of the session is the time constant");
}

/// Depth error at one reading, mm.
fn error(instrument: &Instrument, z: f64, ray: [f64; 2], cosine: f64, amplitude: f64) -> f64 {
    let reading = Reading { pixel: [100.0, 100.0], ray, cosine, amplitude, conditions: when(0.0, 30.0) };
    1.0 / instrument.measure(&reading, 1.0 / z) - z
}

#[test]
fn sizes_at_a_point() {
    let offset = with("range_offset", SIZE, 0);
    close(error(&offset, 700.0, [0.0, 0.0], 1.0, 0.5), SIZE, 1e-9, "range_offset");
    close(error(&offset, 700.0, [0.6, 0.0], 1.0, 0.5), SIZE / 1.36f64.sqrt(), 1e-9, "range_offset");

    let incidence = with("incidence_bias", SIZE, 0);
    close(error(&incidence, 700.0, [0.0, 0.0], 0.5f64.sqrt(), 0.5), SIZE, 1e-9, "incidence_bias");

    let reflectivity = with("reflectivity_bias", SIZE, 0);
    let error_at = |amplitude| error(&reflectivity, 700.0, [0.0, 0.0], 1.0, amplitude);
    close(error_at(0.04) - error_at(0.4), SIZE, 1e-9, "dark reads too far");

    let cyclic = with("cyclic_depth", SIZE, 0);
    let wave = |z: f64| error(&cyclic, z, [0.0, 0.0], 1.0, 0.5);
    // The fundamental's amplitude, by Fourier analysis over one period.
    let parts = (0..300).map(|i| {
        let z = 500.0 + f64::from(i);
        let angle = std::f64::consts::TAU * z / 300.0;
        (wave(z) * angle.cos(), wave(z) * angle.sin())
    });
    let (c, s) = parts.fold((0.0, 0.0), |sum, part| (sum.0 + part.0 / 150.0, sum.1 + part.1 / 150.0));
    close(c.hypot(s), SIZE, 1e-6, "cyclic_depth");

    close(error(&with("edge_step", SIZE, 0), 700.0, [0.0, 0.0], 1.0, 0.5), SIZE, 1e-9, "edge_step");
}

#[test]
fn sizes_of_the_board() {
    for unit in [0, 3] {
        let bowed = with("board_bow", SIZE, unit).shape;
        let heights: Vec<f64> = (0..=34)
            .flat_map(|i| (0..=24).map(move |j| [f64::from(j) * 119.0 / 24.0, f64::from(i) * 5.0]))
            .map(|p| bowed.height(p).0)
            .collect();
        let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
        close(highest - lowest, SIZE, 0.02, "board_bow");
    }
    let stretched = with("print_scale", SIZE, 0).shape;
    assert_eq!(stretched.real([119.0, 0.0])[..2], [119.0, 0.0]);
    close(stretched.real([0.0, 170.0])[1] - 170.0, SIZE, 1e-9, "print_scale");
}

#[test]
fn sizes_in_pixels() {
    let base = Optics::new(&camera());
    let shift = |name: &str, size: f64, unit: u64| {
        let after = with(name, size, unit).optics;
        let grid = (0..480).step_by(9).flat_map(|v| (0..640).step_by(9).map(move |u| [f64::from(u), f64::from(v)]));
        let squares: Vec<f64> = grid
            .filter_map(|pixel| {
                let [x, y] = base.ray(pixel, 0.001)?;
                let moved = after.project([x, y, 1.0])?;
                Some((moved[0] - pixel[0]).powi(2) + (moved[1] - pixel[1]).powi(2))
            })
            .collect();
        assert!(squares.len() > 3700, "{name}: the image must not fold");
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    for unit in [0, 5] {
        for size in [0.2, 1.0] {
            close(shift("thin_prism", size, unit), size, 0.05, "thin_prism");
            close(shift("tilted_sensor", size, unit), size, 0.05, "tilted_sensor");
        }
        for size in [0.1, 0.8] {
            close(shift("rational_distortion", size, unit), size, 0.15, "rational_distortion");
        }
    }
    let moved = with("depth_registration", SIZE, 2).registration;
    close(moved[0].hypot(moved[1]), SIZE, 1e-9, "depth_registration");
    let breathing = with("focus_breathing", 1.0, 0).optics;
    let [near, far] = [500.0, 1000.0].map(|z| breathing.project([0.5 * z, 0.0, z]).unwrap()[0] - 312.97);
    close((near - far) / near.midpoint(far) * 240.0, 1.0, 0.01, "focus_breathing");
}

#[test]
fn sizes_that_cannot_be_reached_are_errors() {
    for text in ["rational_distortion=500", "focus_breathing=100", "tilted_sensor=1e5"] {
        let effect = Effect::parse(text).unwrap().unwrap();
        let result = install(&camera(), &Board::default(), &[effect], 0, 0);
        assert!(matches!(result, Err(SimulateError::EffectTooLarge { .. })), "{text}");
    }
}

#[test]
fn every_published_camera_can_have_every_effect_at_its_default_size() {
    for number in 1..=4 {
        let camera = CameraTruth::published(number).unwrap();
        for unit in 0..6 {
            for info in catalogue().iter().chain(uncatalogued()).chain(of_whole_frames()) {
                let effect = Effect::with_default_size(info.name).unwrap();
                install(&camera, &Board::default(), &[effect], unit, 0).unwrap();
            }
        }
    }
}

#[test]
fn no_effect_at_size_zero_and_all_effects_together() {
    let zero: Vec<Effect> = catalogue()
        .iter()
        .chain(uncatalogued())
        .chain(of_whole_frames())
        .map(|info| Effect::new(info.name, 0.0).unwrap())
        .collect();
    let (instrument, truths) = install(&camera(), &Board::default(), &zero, 0, 0).unwrap();
    assert_eq!(truths.len(), zero.len());
    assert!(error(&instrument, 800.0, [0.3, 0.2], 0.8, 0.2).abs() < 1e-9);
    let pixel = instrument.optics.project([200.0, 100.0, 800.0]).unwrap();
    let plain = Optics::new(&camera()).project([200.0, 100.0, 800.0]).unwrap();
    assert!((pixel[0] - plain[0]).hypot(pixel[1] - plain[1]) < 1e-6);
}
