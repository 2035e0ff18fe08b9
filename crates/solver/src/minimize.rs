//! The short way to a solution.

use crate::error::SolveError;
use crate::graph::Graph;
use crate::options::Options;
use crate::report::Report;
use crate::session::Session;
use crate::values::Values;

/// Estimated values and how they came about.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best values found.
    pub values: Values,
    /// What happened.
    pub report: Report,
}

/// Minimises ½ Σ ρ(‖r(x)‖²) by Levenberg–Marquardt or what [`Options::method`] says, starting from `values`, or from the
/// state in the file that [`Options::checkpoint`] names.
///
/// Not having converged is no error: see [`Report::termination`].
///
/// # Errors
/// If graph and values do not fit together, an option makes no sense, a checkpoint belongs to something else, or the factors
/// cannot be evaluated at the start.
pub fn minimize(graph: &Graph, values: Values, options: &Options) -> Result<Solution, SolveError> {
    Session::new(options.clone()).solve(graph, values)
}
