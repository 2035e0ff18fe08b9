//! A numpy function as a piece of the chain.
//!
//! The function gives a value e at arrays of covariates and values of parameters. It is added to depth (z + e), to inverse depth
//! (ρ + e) or to the factor of depth (z (1 + e)), as a formula's value is. e is differentiated by central differences; what it is
//! added to is differentiated exactly.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use depthcal_formula::FormulaCovariate;
use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, AnyPiece, Context, Covariate, On, Options, Parameter};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::arrays::numbers;
use crate::failure::input;
use crate::unwound::raise;

/// Numbers of a state of the depth hook: x, y, inverse depth, cosine of the angle of incidence.
const STATE: usize = 4;
/// Step of a difference relative to the size of a number: the cube root of the rounding error, where the errors of rounding and
/// of curvature are equal.
const STEP: f64 = 6e-6;

/// A function with all that is said of it.
#[derive(Debug)]
pub(crate) struct FunctionContent {
    pub name: &'static str,
    summary: &'static str,
    source: &'static str,
    pub parameters: Vec<Parameter>,
    adds_to: AddsTo,
    covariates: Vec<FormulaCovariate>,
    needs: &'static [Covariate],
    /// The numbers of the state on which the covariates depend.
    varied: Vec<usize>,
    function: Py<PyAny>,
    /// Calls so far, points of all calls, and time within them.
    pub calls: AtomicU64,
    pub points: AtomicU64,
    pub nanoseconds: AtomicU64,
}

/// A text that lives as long as the program, as pieces have them. An effect has a handful.
pub(crate) fn text(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

/// The numbers of the state on which a covariate depends.
fn depends_on(covariate: FormulaCovariate) -> &'static [usize] {
    use FormulaCovariate as C;
    match covariate {
        C::X => &[0],
        C::Y => &[1],
        C::R => &[0, 1],
        C::Z | C::Rho => &[2],
        C::Range => &[0, 1, 2],
        C::Incidence => &[3],
        _ => &[],
    }
}

impl FunctionContent {
    pub fn new(
        name: &'static str,
        summary: &'static str,
        source: &'static str,
        parameters: Vec<Parameter>,
        adds_to: AddsTo,
        covariates: Vec<FormulaCovariate>,
        function: Py<PyAny>,
    ) -> Self {
        let mut varied: Vec<usize> = covariates.iter().flat_map(|c| depends_on(*c)).copied().collect();
        varied.sort_unstable();
        varied.dedup();
        let needs: Vec<Covariate> = covariates.iter().filter_map(|c| c.needs()).collect();
        let [calls, points, nanoseconds] = std::array::from_fn(|_| AtomicU64::new(0));
        Self {
            name,
            summary,
            source,
            parameters,
            adds_to,
            covariates,
            needs: Box::leak(needs.into_boxed_slice()),
            varied,
            function,
            calls,
            points,
            nanoseconds,
        }
    }

    /// The function's values at states, row by row; 0 where an observation lacks a covariate.
    fn values(&self, theta: &[f64], states: &[f64], contexts: &[Context]) -> Vec<f64> {
        let count = states.len() / STATE;
        if count == 0 {
            return Vec::new();
        }
        // States may be several times as many as contexts: the same observations at changed states.
        let context = |i: usize| &contexts[i % contexts.len()];
        let columns: Vec<Vec<f64>> = self
            .covariates
            .iter()
            .map(|c| states.chunks_exact(STATE).enumerate().map(|(i, state)| c.value(state, context(i))).collect())
            .collect();
        let known: Vec<bool> = (0..count).map(|i| columns.iter().all(|column| !column[i].is_nan())).collect();
        let started = Instant::now();
        let result = Python::attach(|py| self.call(py, theta, columns, count));
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.points.fetch_add(count as u64, Ordering::Relaxed);
        self.nanoseconds.fetch_add(started.elapsed().as_nanos() as u64, Ordering::Relaxed);
        let mut values = match result {
            Ok(values) => values,
            Err(error) => raise(error),
        };
        values.iter_mut().zip(known).filter(|(_, known)| !known).for_each(|(value, _)| *value = 0.0);
        values
    }

    fn call(&self, py: Python<'_>, theta: &[f64], columns: Vec<Vec<f64>>, count: usize) -> PyResult<Vec<f64>> {
        let arrays = PyList::new(py, columns.into_iter().map(|column| column.into_pyarray(py)))?;
        let theta = PyTuple::new(py, theta)?;
        let result = self.function.bind(py).call1((theta, arrays))?;
        let values = numbers(&format!("effect '{}': the function's result", self.name), &result)?.slice()?.to_vec();
        if values.len() != count {
            let given = values.len();
            return Err(
                input(format!("effect '{}': the function gave {given} values at {count} points", self.name)).into()
            );
        }
        Ok(values)
    }
}

/// A numpy function as a piece.
#[derive(Debug)]
pub(crate) struct FunctionPiece {
    content: Arc<FunctionContent>,
}

impl FunctionPiece {
    pub fn new(content: Arc<FunctionContent>) -> Self {
        Self { content }
    }

    /// Measured inverse depth for the value e, and its derivatives by ρ (with e constant) and by e.
    fn combine(&self, rho: f64, e: f64) -> [f64; 3] {
        match self.content.adds_to {
            AddsTo::InverseDepth => [rho + e, 1.0, 1.0],
            AddsTo::Factor => {
                let below = 1.0 / (1.0 + e);
                [rho * below, below, -rho * below * below]
            }
            _ => {
                let below = 1.0 / (1.0 + e * rho);
                [rho * below, below * below, -rho * rho * below * below]
            }
        }
    }
}

/// The states with number `k` moved by a step of its own, up or down.
fn moved(states: &[f64], k: usize, sign: f64) -> (Vec<f64>, Vec<f64>) {
    let mut moved = states.to_vec();
    let steps = moved
        .chunks_exact_mut(STATE)
        .map(|state| {
            // Directions are of the size of the image plane, a cosine of 1; inverse depth is as large as it is.
            let size = if k == 2 { state[2].abs().max(1e-6) } else { 1.0 };
            let before = state[k];
            state[k] += sign * STEP * size;
            // As rounding left it.
            state[k] - before
        })
        .collect();
    (moved, steps)
}

impl AnyPiece for FunctionPiece {
    fn name(&self) -> &'static str {
        self.content.name
    }
    fn summary(&self) -> &'static str {
        self.content.summary
    }
    fn source(&self) -> &'static str {
        self.content.source
    }
    fn hook(&self) -> HookKind {
        HookKind::Depth
    }
    fn parameters(&self) -> &[Parameter] {
        &self.content.parameters
    }
    fn options(&self) -> Options {
        Options::new()
    }
    fn needs(&self) -> &'static [Covariate] {
        self.content.needs
    }
    fn form(&self) -> On {
        match self.content.adds_to {
            AddsTo::InverseDepth => On::InverseDepth,
            AddsTo::Factor => On::Factor,
            _ => On::Depth,
        }
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        let values = self.content.values(theta, states, contexts);
        for ((state, e), out) in states.chunks_exact(STATE).zip(values).zip(out) {
            *out = self.combine(state[2], e)[0];
        }
    }

    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: Option<&mut [f64]>,
    ) {
        let content = &*self.content;
        let count = states.len() / STATE;
        if count == 0 {
            return;
        }
        // One call for the values and all differences by the state.
        let mut all = states.to_vec();
        let mut steps = Vec::new();
        for k in &content.varied {
            let (up, above) = moved(states, *k, 1.0);
            let (down, below) = moved(states, *k, -1.0);
            all.extend(up);
            all.extend(down);
            steps.push(above.into_iter().zip(below).map(|(above, below)| above - below).collect::<Vec<f64>>());
        }
        let values = content.values(theta, &all, &contexts[..count]);
        let combined: Vec<[f64; 3]> = (0..count).map(|i| self.combine(states[i * STATE + 2], values[i])).collect();
        d_state[..count * STATE].fill(0.0);
        for (i, [value, by_rho, _]) in combined.iter().enumerate() {
            out[i] = *value;
            d_state[i * STATE + 2] = *by_rho;
        }
        for (place, (k, steps)) in content.varied.iter().zip(&steps).enumerate() {
            let (up, down) = ((1 + 2 * place) * count, (2 + 2 * place) * count);
            for i in 0..count {
                let slope = (values[up + i] - values[down + i]) / steps[i];
                d_state[i * STATE + k] += combined[i][2] * slope;
            }
        }
        let Some(d_theta) = d_theta else { return };
        let parameters = theta.len();
        for (p, parameter) in content.parameters.iter().enumerate() {
            let step = STEP * parameter.scale.abs().max(theta[p].abs());
            let values_moved = |sign: f64| {
                let mut theta = theta.to_vec();
                theta[p] += sign * step;
                (theta[p], content.values(&theta, states, contexts))
            };
            let ((above, up), (below, down)) = (values_moved(1.0), values_moved(-1.0));
            for i in 0..count {
                let slope = (up[i] - down[i]) / (above - below);
                d_theta[i * parameters + p] = combined[i][2] * slope;
            }
        }
    }
}
