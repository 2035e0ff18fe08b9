//! Minimisation in one call.

use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::step::error::SolveError;
use crate::step::options::Options;
use crate::step::session::Session;
use crate::step::solution::Solution;

/// Minimises ½ Σ ρ(‖r(x)‖²) by the method of [`Options::method`], starting from `values`, or from the state in the file of
/// [`Options::checkpoint`] if it exists.
///
/// Not to converge is not an error: see [`Report::termination`](crate::Report::termination).
///
/// # Errors
/// If graph and values do not fit together, an option is out of its range, a checkpoint belongs to another problem, or the
/// factors cannot be evaluated at the start values.
pub fn minimize(graph: &Graph, values: Values, options: &Options) -> Result<Solution, SolveError> {
    Session::new(options.clone()).solve(graph, values)
}
