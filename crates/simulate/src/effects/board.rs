//! Effects on the board: it is bent, its surface is uneven, or its print is stretched.

use super::info::{Parameters, parameters};
use super::sizing::Context;
use crate::error::SimulateError;
use crate::instrument::{Instrument, SurfaceWave};

/// Bends the board: h = a ξ² + b η² + c ξη, ξ and η from −1 to 1 over the markers.
pub(super) fn board_bow(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let form = [context.near(0.5, 0.4), context.near(1.0, 0.3), context.near(0.3, 0.3)];
    let steps: Vec<f64> = (0..=20).map(|i| f64::from(i) / 10.0 - 1.0).collect();
    let heights = || {
        steps
            .iter()
            .flat_map(|&xi| steps.iter().map(move |&eta| form[0] * xi * xi + form[1] * eta * eta + form[2] * xi * eta))
    };
    let peak_to_valley = heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min);
    let [a, b, c] = form.map(|f| f * size / peak_to_valley);
    to.shape.bow = [a, b, c];
    Ok(parameters([("a_mm", a), ("b_mm", b), ("c_mm", c)]))
}

/// Waves in the board's surface along both sides, odd about its centre. A pose takes up their slope.
pub(super) fn board_warp(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let wave = |height| SurfaceWave { height, radians: context.near(2.5, 0.1) };
    let waves = [wave(context.near(1.0, 0.3)), wave(context.near(0.7, 0.3))];
    let span = |wave: &SurfaceWave| {
        let heights = (0..=40).map(|i| wave.at(f64::from(i) / 20.0 - 1.0).0);
        heights.clone().fold(f64::NEG_INFINITY, f64::max) - heights.fold(f64::INFINITY, f64::min)
    };
    let peak_to_valley: f64 = waves.iter().map(span).sum();
    to.shape.waves = waves.map(|w| SurfaceWave { height: w.height * size / peak_to_valley, ..w });
    let [x, y] = to.shape.waves;
    Ok(parameters([("x_mm", x.height), ("x_radians", x.radians), ("y_mm", y.height), ("y_radians", y.radians)]))
}

/// Stretches the print along y.
pub(super) fn print_scale(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let [_, y0, _, y1] = context.board.marker_rectangle();
    let stretch = size / (y1 - y0).max(context.board.spacing_mm);
    to.shape.stretch_y = stretch;
    Ok(parameters([("stretch", stretch)]))
}
