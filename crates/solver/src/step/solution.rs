//! The result of a minimisation.

use crate::problem::values::Values;
use crate::step::report::Report;

/// The estimated values and the report of the minimisation.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best values found.
    pub values: Values,
    /// Convergence, cost and the course of the iterations.
    pub report: Report,
}
