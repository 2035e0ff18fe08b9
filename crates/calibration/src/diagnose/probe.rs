//! Free functions of a covariate: they take up any structure along it and name nothing.
//!
//! A named effect has to hold its own against them. Where a free function gains on left-out frames what no named effect
//! gains, something is there that the catalogue does not have.

use std::collections::BTreeMap;
use std::sync::Arc;

use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Block, Context, Parameter, Role};
use nalgebra::DMatrix;

use super::sight::{Range, Sights};

/// What a free function is a function of.
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
    /// Whether it is the pixel's position, which a map over the image describes.
    pub fn is_of_the_pixel(self) -> bool {
        matches!(self, Along::Pixel | Along::Column | Along::Row)
    }

    /// Words for reports.
    pub fn words(self) -> &'static str {
        match self {
            Along::Pixel => "position in the image",
            Along::Column => "image column",
            Along::Row => "image row",
            Along::Depth => "depth",
            Along::Amplitude => "infrared amplitude",
            Along::Incidence => "angle of incidence",
            Along::Time => "time",
            Along::Temperature => "temperature",
            Along::Board => "position on the board",
        }
    }
}

/// How a free function changes the measured inverse depth ρ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Action {
    /// ρ + f: a bias of disparity.
    Disparity,
    /// ρ − ρ² f: a bias of depth.
    Depth,
    /// Board height f.
    Height,
}

/// One dimension of a tensor product of B-splines.
#[derive(Debug, Clone, Copy)]
struct Axis {
    low: f64,
    high: f64,
    count: usize,
    /// Linear (1) or cubic (3).
    degree: usize,
}

impl Axis {
    /// The first basis function that is not zero at `x`, and the values from there on. Beyond the ends the function goes on
    /// constant.
    fn basis(&self, x: f64) -> (usize, [f64; 4]) {
        let spans = self.count - self.degree;
        let t = ((x - self.low) / (self.high - self.low)).clamp(0.0, 1.0) * spans as f64;
        let span = (t as usize).min(spans - 1);
        let u = t - span as f64;
        let values = if self.degree == 1 {
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

/// A free function as a piece of the chain.
#[derive(Debug)]
struct FreeFunction {
    name: &'static str,
    along: Along,
    action: Action,
    axes: Vec<Axis>,
    parameters: Vec<Parameter>,
}

impl FreeFunction {
    fn coordinates(&self, state: &[f64], context: &Context) -> [f64; 2] {
        match self.along {
            Along::Pixel => context.pixel,
            Along::Column => [context.pixel[0], 0.0],
            Along::Row => [context.pixel[1], 0.0],
            Along::Depth => [state[2], 0.0],
            Along::Amplitude => [context.amplitude.max(1e-300).ln(), 0.0],
            Along::Incidence => [state[3], 0.0],
            Along::Time => [context.time_s, 0.0],
            Along::Temperature => [context.temperature_c, 0.0],
            Along::Board => [state[0], state[1]],
        }
    }

    /// Calls `take` with every basis function that is not zero at an observation.
    fn each(&self, state: &[f64], context: &Context, mut take: impl FnMut(usize, f64)) {
        let at = self.coordinates(state, context);
        // Where the covariate is unknown the function has no say.
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

impl AnyPiece for FreeFunction {
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

    /// Derivatives by the state leave out the slope of f: free functions are tested at zero, where it has none.
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
pub struct Probe {
    /// Name for tables.
    pub name: &'static str,
    /// What it is a function of.
    pub along: Along,
    /// Its block at zero.
    pub block: Block,
    /// Precision of its smoothness prior, up to a factor: squared second differences and a weak pull to zero.
    pub smoothness: DMatrix<f64>,
}

/// Squared second differences along one axis, and a weak pull to zero.
fn roughness(axes: &[Axis]) -> DMatrix<f64> {
    let counts: Vec<usize> = axes.iter().map(|a| a.count).chain(std::iter::once(1)).take(2).collect();
    let (nu, nv) = (counts[0], counts[1]);
    let n = nu * nv;
    let mut p = DMatrix::identity(n, n) * 1e-2;
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

fn probe(name: &'static str, along: Along, action: Action, axes: Vec<Axis>) -> Probe {
    let count = axes.iter().map(|a| a.count).product();
    let unit = if action == Action::Disparity { "1/mm" } else { "mm" };
    let smoothness = roughness(&axes);
    let parameters = vec![Parameter::new("c", unit, 0.0, 1.0); count];
    let block =
        Block::new(Arc::new(FreeFunction { name, along, action, axes, parameters }) as Arc<dyn AnyPiece>).hold();
    Probe { name, along, block, smoothness }
}

/// All free functions that these data can hold: along covariates that are known and vary.
pub fn probes(sights: &Sights, width: usize, height: usize, board: [[f64; 2]; 2]) -> Vec<Probe> {
    let axis = |low: f64, high: f64, count: usize, degree: usize| Axis { low, high, count, degree };
    let (u, v) = (|n, d| axis(0.0, width as f64 - 1.0, n, d), |n, d| axis(0.0, height as f64 - 1.0, n, d));
    let mut list = vec![
        probe("map", Along::Pixel, Action::Disparity, vec![u(7, 3), v(6, 3)]),
        probe("map of depth", Along::Pixel, Action::Depth, vec![u(7, 3), v(6, 3)]),
        probe("columns", Along::Column, Action::Depth, vec![u(24, 1)]),
        probe("rows", Along::Row, Action::Depth, vec![v(24, 1)]),
        probe(
            "board",
            Along::Board,
            Action::Height,
            vec![axis(board[0][0], board[1][0], 4, 3), axis(board[0][1], board[1][1], 4, 3)],
        ),
    ];
    let mut along = |name, along, range: Option<Range>, count: usize, least_span: f64| {
        if let Some(range) = range.filter(|r| r.span() > least_span) {
            list.push(probe(name, along, Action::Depth, vec![axis(range.low, range.high, count, 3)]));
        }
    };
    along("depth", Along::Depth, sights.range(|s, _| s[2]), 14, 0.0);
    along("amplitude", Along::Amplitude, sights.range(|_, c| c.amplitude.max(1e-300).ln()), 6, 0.05);
    along("incidence", Along::Incidence, sights.range(|s, _| s[3]), 5, 0.02);
    along("time", Along::Time, sights.range(|_, c| c.time_s), 6, 1e-3);
    along("temperature", Along::Temperature, sights.range(|_, c| c.temperature_c), 5, 0.05);
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    /// B-splines sum to one everywhere, so a free function holds every constant.
    #[test]
    fn splines_are_a_partition_of_unity() {
        for degree in [1, 3] {
            let axis = Axis { low: -2.0, high: 5.0, count: 9, degree };
            for i in 0..=100 {
                let (first, values) = axis.basis(-2.5 + 0.08 * f64::from(i));
                assert!(first + degree < 9);
                assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    /// Constants and lines along either axis are not rough.
    #[test]
    fn smooth_functions_cost_no_more_than_the_pull_to_zero() {
        let axis = |count| Axis { low: 0.0, high: 1.0, count, degree: 3 };
        let p = roughness(&[axis(5), axis(4)]) - DMatrix::identity(20, 20) * 1e-2;
        let plane = nalgebra::DVector::from_fn(20, |i, _| 1.0 + 0.5 * (i % 5) as f64 - 2.0 * (i / 5) as f64);
        assert!((plane.transpose() * &p * &plane)[(0, 0)].abs() < 1e-10);
        let bent = plane.map(|x| x * x);
        assert!((bent.transpose() * &p * &bent)[(0, 0)] > 1.0);
    }
}
