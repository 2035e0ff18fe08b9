//! Splines of one covariate, or of two, as a piece of the chain.

use std::collections::BTreeMap;

use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Context, Of, On, Parameter, Placement, REFERENCE_DEPTH_MM, Role};
use depthcal_solver::additive::Axis;

use super::along::Along;

/// Where a free function f acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Action {
    /// On depth, in first order: ρ + f on inverse depth, ρ − ρ² f on depth, ρ (1 − f / z₀) as a factor, with the reference depth
    /// z₀ ([`REFERENCE_DEPTH_MM`]).
    Depth(Of, On),
    /// On the height of the board.
    Height,
}

impl Action {
    /// Change of inverse depth ρ by f = 1.
    fn slope(on: On, rho: f64) -> f64 {
        match on {
            On::Depth => -rho * rho,
            On::InverseDepth => 1.0,
            On::Factor => -rho / REFERENCE_DEPTH_MM,
        }
    }
}

/// A free function as a piece of the chain. Its parameters are the coefficients of a tensor product of B-splines.
#[derive(Debug)]
pub(super) struct SplinePiece {
    pub name: &'static str,
    pub along: Along,
    pub action: Action,
    pub axes: Vec<Axis>,
    pub parameters: Vec<Parameter>,
}

impl SplinePiece {
    /// Calls `take` with number and value of every basis function that is not zero at an observation.
    fn each(&self, state: &[f64], context: &Context, mut take: impl FnMut(usize, f64)) {
        let coordinates = self.along.coordinates(state, context);
        // Where the covariate is unknown the function is zero.
        if !coordinates[0].is_finite() || !coordinates[1].is_finite() {
            return;
        }
        let (first, a) = self.axes[0].basis(coordinates[0]);
        let width = self.axes[0].degree + 1;
        match self.axes.get(1) {
            None => (0..width).for_each(|i| take(first + i, a[i])),
            Some(second) => {
                let (row, b) = second.basis(coordinates[1]);
                for k in 0..=second.degree {
                    for i in 0..width {
                        take((row + k) * self.axes[0].count + first + i, a[i] * b[k]);
                    }
                }
            }
        }
    }
}

impl AnyPiece for SplinePiece {
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
    fn placement(&self) -> Placement {
        match self.action {
            Action::Depth(of, _) => Placement { of, on: None },
            Action::Height => Placement::default(),
        }
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        let (ins, outs) = if self.action == Action::Height { (3, 3) } else { (4, 1) };
        for ((state, context), y) in states.chunks_exact(ins).zip(contexts).zip(out.chunks_exact_mut(outs)) {
            let mut f = 0.0;
            self.each(state, context, |i, b| f += theta[i] * b);
            match self.action {
                Action::Depth(_, on) => y[0] = state[2] + Action::slope(on, state[2]) * f,
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
            match self.action {
                Action::Height => {
                    let state = &states[3 * k..3 * k + 3];
                    (0..3).for_each(|i| d_state[9 * k + 4 * i] = 1.0);
                    if let Some(d) = d_theta.as_deref_mut() {
                        self.each(state, context, |i, b| d[(3 * k + 2) * n + i] = b);
                    }
                }
                Action::Depth(_, on) => {
                    let state = &states[4 * k..4 * k + 4];
                    d_state[4 * k + 2] = 1.0;
                    let slope = Action::slope(on, state[2]);
                    if let Some(d) = d_theta.as_deref_mut() {
                        self.each(state, context, |i, b| d[k * n + i] = b * slope);
                    }
                }
            }
        }
    }
}
