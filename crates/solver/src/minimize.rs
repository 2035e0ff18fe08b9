//! The short way to a solution.

use argmin::core::{Executor, State};

use crate::error::SolveError;
use crate::graph::Graph;
use crate::levenberg_marquardt::{LevenbergMarquardt, SolverState};
use crate::options::Options;
use crate::report::Report;
use crate::values::Values;

/// Estimated values and how they came about.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best values found.
    pub values: Values,
    /// What happened.
    pub report: Report,
}

/// Minimises ½ Σ ρ(‖r(x)‖²) by Levenberg–Marquardt or what [`Options::method`] says, starting from `values`.
///
/// Not having converged is no error: see [`Report::termination`].
///
/// # Errors
/// If graph and values do not fit together, an option makes no sense, or the factors cannot be evaluated at the start.
pub fn minimize(graph: &Graph, values: Values, options: &Options) -> Result<Solution, SolveError> {
    let mut executor = Executor::new(graph, LevenbergMarquardt::new(options.clone()))
        .configure(|state: SolverState| state.param(values).max_iters(options.max_iterations))
        .ctrlc(options.ctrlc)
        .timer(false);
    if let Some(limit) = options.time_limit {
        executor = executor.timeout(limit);
    }
    let mut result = executor.run().map_err(|error| match error.downcast::<SolveError>() {
        Ok(error) => error,
        Err(error) => SolveError::Executor { reason: error.to_string() },
    })?;
    result.solver.stopped_by_executor(result.state.get_termination_reason());
    let report = result.solver.report();
    // Steps never make the cost worse but for rounding: the last values are the best.
    match result.state.take_param().or_else(|| result.state.take_best_param()) {
        Some(values) => Ok(Solution { values, report }),
        None => Err(SolveError::Executor { reason: "the executor lost the values".to_owned() }),
    }
}
