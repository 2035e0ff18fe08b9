//! Free functions: splines of one covariate each, which describe any structure along it and name no cause.
//!
//! They compete with the named effects. Where a free function gains on held-out frames what no named effect gains, the
//! residuals have structure that no effect of the register describes.

use std::collections::BTreeMap;
use std::sync::Arc;

use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Block, Context, Parameter, Role};
use nalgebra::DMatrix;

use super::observed_states::{ObservedStates, Range};
use super::thresholds::Thresholds;

/// Degrees of the splines.
const LINEAR: usize = 1;
const CUBIC: usize = 3;
/// Basis functions of a map over the image, along its columns and its rows.
const MAP: [usize; 2] = [7, 6];
/// Basis functions along image columns or rows alone, where errors of single lines show.
const LINES: usize = 24;
/// Basis functions along each side of the board.
const BOARD: usize = 4;
/// Basis functions over inverse depth, over which errors may be waves.
const DEPTH: usize = 14;
/// Basis functions over the logarithm of the amplitude, the cosine of incidence, time and temperature.
const AMPLITUDE: usize = 6;
const INCIDENCE: usize = 5;
const TIME: usize = 6;
const TEMPERATURE: usize = 5;

/// The covariate of a free function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Along {
    /// Pixel position, both coordinates together.
    Pixel,
    /// Image column.
    Column,
    /// Image row.
    Row,
    /// Inverse depth.
    Depth,
    /// Infrared amplitude, its logarithm.
    Amplitude,
    /// Angle of incidence, its cosine.
    Incidence,
    /// Time.
    Time,
    /// Temperature.
    Temperature,
    /// Position on the board: its shape.
    Board,
}

impl Along {
    /// Whether the covariate is the pixel's position, or a part of it: then a map over the image can correct the depth.
    pub fn is_of_the_pixel(self) -> bool {
        matches!(self, Along::Pixel | Along::Column | Along::Row)
    }
}

/// The quantity to which a free function f is added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Action {
    /// Measured inverse depth, ρ + f: a bias of disparity.
    Disparity,
    /// Measured depth, in first order ρ − ρ² f.
    Depth,
    /// Height of the board.
    Height,
}

/// One dimension of a tensor product of B-splines.
#[derive(Debug, Clone, Copy)]
struct Axis {
    low: f64,
    high: f64,
    count: usize,
    /// [`LINEAR`] or [`CUBIC`].
    degree: usize,
}

impl Axis {
    /// Number of the first basis function that is not zero at `x`, and the values of it and of the next ones. Beyond the ends
    /// of the axis the functions are constant.
    fn basis(&self, x: f64) -> (usize, [f64; 4]) {
        let spans = self.count - self.degree;
        let t = ((x - self.low) / (self.high - self.low)).clamp(0.0, 1.0) * spans as f64;
        let span = (t as usize).min(spans - 1);
        let u = t - span as f64;
        let values = if self.degree == LINEAR {
            [1.0 - u, u, 0.0, 0.0]
        } else {
            // Uniform cubic B-splines.
            let v = 1.0 - u;
            [
                v * v * v / 6.0,
                (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
                (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
                u * u * u / 6.0,
            ]
        };
        (span, values)
    }
}

/// A free function as a piece of the chain. Its parameters are the coefficients of a tensor product of B-splines.
#[derive(Debug)]
struct FreeFunctionPiece {
    name: &'static str,
    along: Along,
    action: Action,
    axes: Vec<Axis>,
    parameters: Vec<Parameter>,
}

impl FreeFunctionPiece {
    /// The covariate of an observation: one number, or two where the function is two-dimensional.
    fn coordinates(&self, state: &[f64], context: &Context) -> [f64; 2] {
        match self.along {
            Along::Pixel => context.pixel,
            Along::Column => [context.pixel[0], 0.0],
            Along::Row => [context.pixel[1], 0.0],
            Along::Depth => [state[2], 0.0],
            Along::Amplitude => [log_amplitude(context), 0.0],
            Along::Incidence => [state[3], 0.0],
            Along::Time => [context.time_s, 0.0],
            Along::Temperature => [context.temperature_c, 0.0],
            Along::Board => [state[0], state[1]],
        }
    }

    /// Calls `take` with number and value of every basis function that is not zero at an observation.
    fn each(&self, state: &[f64], context: &Context, mut take: impl FnMut(usize, f64)) {
        let at = self.coordinates(state, context);
        // Where the covariate is unknown the function is zero.
        if !at[0].is_finite() || !at[1].is_finite() {
            return;
        }
        let (first, a) = self.axes[0].basis(at[0]);
        let width = self.axes[0].degree + 1;
        match self.axes.get(1) {
            None => (0..width).for_each(|i| take(first + i, a[i])),
            Some(second) => {
                let (row, b) = second.basis(at[1]);
                for k in 0..=second.degree {
                    for i in 0..width {
                        take((row + k) * self.axes[0].count + first + i, a[i] * b[k]);
                    }
                }
            }
        }
    }
}

impl AnyPiece for FreeFunctionPiece {
    fn name(&self) -> &'static str {
        self.name
    }
    fn source(&self) -> &'static str {
        "tensor products of B-splines"
    }
    fn hook(&self) -> HookKind {
        if self.action == Action::Height { HookKind::Board } else { HookKind::Depth }
    }
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn options(&self) -> BTreeMap<String, f64> {
        BTreeMap::new()
    }
    fn role(&self) -> Role {
        Role::Map
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        let (ins, outs) = if self.action == Action::Height { (3, 3) } else { (4, 1) };
        for ((state, context), y) in states.chunks_exact(ins).zip(contexts).zip(out.chunks_exact_mut(outs)) {
            let mut f = 0.0;
            self.each(state, context, |i, b| f += theta[i] * b);
            match self.action {
                Action::Disparity => y[0] = state[2] + f,
                Action::Depth => y[0] = state[2] - state[2] * state[2] * f,
                Action::Height => y.copy_from_slice(&[state[0], state[1], state[2] + f]),
            }
        }
    }

    /// The derivatives by the state omit the slope of f: free functions are tested at f = 0, where the slope vanishes.
    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        mut d_theta: Option<&mut [f64]>,
    ) {
        self.evaluate(theta, states, contexts, out);
        let n = self.parameters.len();
        d_state.fill(0.0);
        if let Some(d) = d_theta.as_deref_mut() {
            d.fill(0.0);
        }
        for (k, context) in contexts.iter().enumerate() {
            if self.action == Action::Height {
                let state = &states[3 * k..3 * k + 3];
                (0..3).for_each(|i| d_state[9 * k + 4 * i] = 1.0);
                if let Some(d) = d_theta.as_deref_mut() {
                    self.each(state, context, |i, b| d[(3 * k + 2) * n + i] = b);
                }
            } else {
                let state = &states[4 * k..4 * k + 4];
                d_state[4 * k + 2] = 1.0;
                let scale = if self.action == Action::Depth { -state[2] * state[2] } else { 1.0 };
                if let Some(d) = d_theta.as_deref_mut() {
                    self.each(state, context, |i, b| d[k * n + i] = b * scale);
                }
            }
        }
    }
}

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

/// Weight of the ridge relative to squared second differences.
const RIDGE: f64 = 1e-2;

/// Precision matrix of second differences along every axis, and a weak ridge.
fn smoothness_precision(axes: &[Axis]) -> DMatrix<f64> {
    let counts: Vec<usize> = axes.iter().map(|a| a.count).chain(std::iter::once(1)).take(2).collect();
    let (nu, nv) = (counts[0], counts[1]);
    let n = nu * nv;
    let mut p = DMatrix::identity(n, n) * RIDGE;
    let mut add = |cells: [usize; 3]| {
        let weights = [1.0, -2.0, 1.0];
        for (a, wa) in cells.iter().zip(weights) {
            for (b, wb) in cells.iter().zip(weights) {
                p[(*a, *b)] += wa * wb;
            }
        }
    };
    for v in 0..nv {
        (1..nu.saturating_sub(1)).for_each(|u| add([v * nu + u - 1, v * nu + u, v * nu + u + 1]));
    }
    for u in 0..nu {
        (1..nv.saturating_sub(1)).for_each(|v| add([(v - 1) * nu + u, v * nu + u, (v + 1) * nu + u]));
    }
    p
}

fn free_function(name: &'static str, along: Along, action: Action, axes: Vec<Axis>) -> FreeFunction {
    let count = axes.iter().map(|a| a.count).product();
    let unit = if action == Action::Disparity { "1/mm" } else { "mm" };
    let smoothness = smoothness_precision(&axes);
    let parameters = vec![Parameter::new("c", unit, 0.0, 1.0); count];
    let block =
        Block::new(Arc::new(FreeFunctionPiece { name, along, action, axes, parameters }) as Arc<dyn AnyPiece>).hold();
    FreeFunction { name, along, block, smoothness }
}

/// Logarithm of the infrared amplitude; finite for an amplitude of zero.
fn log_amplitude(context: &Context) -> f64 {
    context.amplitude.max(1e-300).ln()
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
    let axis = |low: f64, high: f64, count: usize, degree: usize| Axis { low, high, count, degree };
    let (u, v) = (|n, d| axis(0.0, width as f64 - 1.0, n, d), |n, d| axis(0.0, height as f64 - 1.0, n, d));
    let mut list = vec![
        free_function("map", Along::Pixel, Action::Disparity, vec![u(MAP[0], CUBIC), v(MAP[1], CUBIC)]),
        free_function("map of depth", Along::Pixel, Action::Depth, vec![u(MAP[0], CUBIC), v(MAP[1], CUBIC)]),
        free_function("columns", Along::Column, Action::Depth, vec![u(LINES, LINEAR)]),
        free_function("rows", Along::Row, Action::Depth, vec![v(LINES, LINEAR)]),
        free_function(
            "board",
            Along::Board,
            Action::Height,
            vec![axis(board[0][0], board[1][0], BOARD, CUBIC), axis(board[0][1], board[1][1], BOARD, CUBIC)],
        ),
    ];
    let mut along = |name, along, range: Option<Range>, count: usize, least_span: f64| {
        if let Some(range) = range.filter(|r| r.span() > least_span) {
            list.push(free_function(name, along, Action::Depth, vec![axis(range.low, range.high, count, CUBIC)]));
        }
    };
    along("depth", Along::Depth, states.range(|s, _| s[2]), DEPTH, 0.0);
    let amplitude = states.range(|_, c| log_amplitude(c));
    along("amplitude", Along::Amplitude, amplitude, AMPLITUDE, thresholds.least_log_amplitude_span);
    along("incidence", Along::Incidence, states.range(|s, _| s[3]), INCIDENCE, thresholds.least_cos_incidence_span);
    along("time", Along::Time, states.range(|_, c| c.time_s), TIME, thresholds.least_time_span_s);
    let temperature = states.range(|_, c| c.temperature_c);
    along("temperature", Along::Temperature, temperature, TEMPERATURE, thresholds.least_temperature_span_c);
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    /// B-splines sum to one everywhere, so that constants are free functions.
    #[test]
    fn splines_are_a_partition_of_unity() {
        for degree in [LINEAR, CUBIC] {
            let axis = Axis { low: -2.0, high: 5.0, count: 9, degree };
            for i in 0..=100 {
                let (first, values) = axis.basis(-2.5 + 0.08 * f64::from(i));
                assert!(first + degree < 9);
                assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    /// Constants and lines along either axis have no second differences.
    #[test]
    fn linear_functions_cost_no_more_than_the_ridge() {
        let axis = |count| Axis { low: 0.0, high: 1.0, count, degree: CUBIC };
        let p = smoothness_precision(&[axis(5), axis(4)]) - DMatrix::identity(20, 20) * RIDGE;
        let plane = nalgebra::DVector::from_fn(20, |i, _| 1.0 + 0.5 * (i % 5) as f64 - 2.0 * (i / 5) as f64);
        assert!((plane.transpose() * &p * &plane)[(0, 0)].abs() < 1e-10);
        let bent = plane.map(|x| x * x);
        assert!((bent.transpose() * &p * &bent)[(0, 0)] > 1.0);
    }
}
