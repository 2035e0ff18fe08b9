//! The linearised problem from which uncertainties are computed.

use crate::normal::normal_equations::NormalEquations;
use crate::plan::linear_solver::LinearSolver;
use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::uncertainty::error::CovarianceError;

/// The normal equations at these values, with active bounded components fixed, and the cost.
pub(crate) fn linearized(
    graph: &Graph,
    values: &Values,
    linear_solver: LinearSolver,
) -> Result<(NormalEquations, f64), CovarianceError> {
    let mut system = NormalEquations::new(graph, values, linear_solver, true)?;
    let mut cost = system.linearize(values)?;
    let active = system.bounds.active(values, system.gradient());
    if !active.is_empty() {
        let mut fixed = graph.clone();
        active.iter().for_each(|(id, component)| fixed.fix_component(*id, *component, values.dim(*id)));
        system = NormalEquations::new(&fixed, values, linear_solver, true)?;
        cost = system.linearize(values)?;
    }
    Ok((system, cost))
}
