//! Free functions: splines of one covariate each, which describe any structure along it and name no cause.
//!
//! They compete with the named effects. Where a free function gains on held-out frames what no named effect gains, the
//! residuals have structure that no effect of the register describes.

use std::sync::Arc;

use depthcal_model::{AnyPiece, Block, Of, On, Parameter};
use depthcal_solver::additive::{Axis, CUBIC, LINEAR, smoothness_precision};
use nalgebra::DMatrix;

pub use super::along::Along;
use super::along::log_amplitude;
use super::observed_states::{ObservedStates, Range};
use super::spline_piece::{Action, SplinePiece};
use super::thresholds::Thresholds;

/// Basis functions of a map over the image, along its columns and its rows.
const MAP: [usize; 2] = [7, 6];
/// Basis functions along image columns or rows alone, where errors of single lines show.
const LINES: usize = 24;
/// Basis functions along each side of the board.
const BOARD: usize = 4;
/// Basis functions over inverse depth, over which errors may be waves.
const DEPTH: usize = 14;
/// Basis functions over radius and inverse depth together.
const RADIUS_AND_DEPTH: [usize; 2] = [6, 6];
/// Basis functions over the logarithm of the amplitude, the cosine of incidence, time and temperature.
const AMPLITUDE: usize = 6;
const INCIDENCE: usize = 5;
const TIME: usize = 6;
const TEMPERATURE: usize = 5;
/// Basis functions over a quantity that the user records.
const QUANTITY: usize = 6;
/// Least range of such a quantity, over its largest value.
const LEAST_QUANTITY_SPAN: f64 = 0.02;

/// A free function, ready to be tested.
#[derive(Debug, Clone)]
pub struct FreeFunction {
    /// Name in tables and files.
    pub name: &'static str,
    /// Its covariate.
    pub along: Along,
    /// Its block, at zero and held.
    pub block: Block,
    /// Precision matrix of its smoothness prior, up to a factor: squared second differences of the coefficients and a weak
    /// ridge.
    pub smoothness: DMatrix<f64>,
}

/// A spline, ready to be tested.
pub(super) fn free_function(name: &'static str, along: Along, action: Action, axes: Vec<Axis>) -> FreeFunction {
    let count = axes.iter().map(|a| a.count).product();
    let unit = if matches!(action, Action::Depth(_, On::InverseDepth)) { "1/mm" } else { "mm" };
    let smoothness = smoothness_precision(&axes);
    let parameters = vec![Parameter::new("c", unit, 0.0, 1.0); count];
    let block = Block::new(Arc::new(SplinePiece { name, along, action, axes, parameters }) as Arc<dyn AnyPiece>).hold();
    FreeFunction { name, along, block, smoothness }
}

/// The free functions of every covariate that is known and varies enough for the data to determine them, over images of
/// `width` by `height` pixels and a board between two corners, mm.
pub fn free_functions(
    states: &ObservedStates,
    width: usize,
    height: usize,
    board: [[f64; 2]; 2],
    thresholds: &Thresholds,
) -> Vec<FreeFunction> {
    let (on_disparity, on_depth) = (Action::Depth(Of::True, On::InverseDepth), Action::Depth(Of::True, On::Depth));
    let axis = |low: f64, high: f64, count: usize, degree: usize| Axis { low, high, count, degree };
    let (u, v) = (|n, d| axis(0.0, width as f64 - 1.0, n, d), |n, d| axis(0.0, height as f64 - 1.0, n, d));
    let mut list = vec![
        free_function("map", Along::Pixel, on_disparity, vec![u(MAP[0], CUBIC), v(MAP[1], CUBIC)]),
        free_function("map of depth", Along::Pixel, on_depth, vec![u(MAP[0], CUBIC), v(MAP[1], CUBIC)]),
        free_function("columns", Along::Column, on_depth, vec![u(LINES, LINEAR)]),
        free_function("rows", Along::Row, on_depth, vec![v(LINES, LINEAR)]),
        free_function(
            "board",
            Along::Board,
            Action::Height,
            vec![axis(board[0][0], board[1][0], BOARD, CUBIC), axis(board[0][1], board[1][1], BOARD, CUBIC)],
        ),
    ];
    let mut along = |name, along, range: Option<Range>, count: usize, least_span: f64| {
        if let Some(range) = range.filter(|r| r.span() > least_span) {
            list.push(free_function(name, along, on_depth, vec![axis(range.low, range.high, count, CUBIC)]));
        }
    };
    let (radii, depths) = (states.range(|s, _| s[0].hypot(s[1])), states.range(|s, _| s[2]));
    along("depth", Along::Depth, depths, DEPTH, 0.0);
    let amplitude = states.range(|_, c| log_amplitude(c));
    along("amplitude", Along::Amplitude, amplitude, AMPLITUDE, thresholds.least_log_amplitude_span);
    along("incidence", Along::Incidence, states.range(|s, _| s[3]), INCIDENCE, thresholds.least_cos_incidence_span);
    along("time", Along::Time, states.range(|_, c| c.time_s), TIME, thresholds.least_time_span_s);
    let temperature = states.range(|_, c| c.temperature_c);
    along("temperature", Along::Temperature, temperature, TEMPERATURE, thresholds.least_temperature_span_c);
    for quantity in states.quantities() {
        let range = states.range(|_, c| c.quantities.value(quantity));
        let least = range.map_or(0.0, |r| LEAST_QUANTITY_SPAN * r.low.abs().max(r.high.abs()));
        along(quantity.name(), Along::Quantity(quantity), range, QUANTITY, least);
    }
    // Lenses and light make errors of the ray that change with depth: functions of either alone do not follow them.
    if let Some((radii, depths)) = radii.zip(depths).filter(|(r, d)| r.span() > 0.0 && d.span() > 0.0) {
        let [of_radius, of_depth] = RADIUS_AND_DEPTH;
        let axes = vec![axis(radii.low, radii.high, of_radius, CUBIC), axis(depths.low, depths.high, of_depth, CUBIC)];
        list.push(free_function("radius and depth", Along::RadiusAndDepth, on_depth, axes));
    }
    list
}
