//! The report of a minimisation.

use std::fmt;

use argmin::core::TerminationReason;
use serde::{Deserialize, Serialize};

use crate::plan::linear_solver::LinearSolverUsed;
use crate::problem::key::VariableId;
use crate::uncertainty::null_direction::NullDirection;

/// Why a solver stopped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Termination {
    /// Converged: the gradient is within its tolerance.
    Gradient,
    /// Converged: the cost no longer decreases by more than its tolerance.
    Cost,
    /// Converged: the step is within the parameter tolerance.
    Parameters,
    /// Converged: the cost cannot be decreased beyond rounding errors.
    Rounding,
    /// No variable is free, or there is no factor.
    NothingToEstimate,
    /// [`Options::max_iterations`](crate::Options::max_iterations) was reached.
    MaxIterations,
    /// [`Options::time_limit`](crate::Options::time_limit) was reached.
    TimeLimit,
    /// Stopped by [`Interrupt`](crate::Interrupt) or Ctrl-C.
    Interrupted,
    /// No step decreases the cost although the linear model predicts a decrease; derivatives may be wrong.
    Stalled,
    /// The factors can be evaluated at the last values, but not differentiated; with the reason.
    NotDifferentiable(String),
}

impl Termination {
    /// Whether the values are a minimum.
    pub fn converged(&self) -> bool {
        matches!(self, Self::Gradient | Self::Cost | Self::Parameters | Self::Rounding | Self::NothingToEstimate)
    }

    /// The reason as argmin's type.
    pub(crate) fn reason(&self) -> TerminationReason {
        if self.converged() {
            TerminationReason::SolverConverged
        } else {
            TerminationReason::SolverExit(self.to_string())
        }
    }
}

impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gradient => "converged: the gradient is within its tolerance",
            Self::Cost => "converged: the decrease of the cost is within its tolerance",
            Self::Parameters => "converged: the step is within the parameter tolerance",
            Self::Rounding => "converged: the cost cannot be decreased beyond rounding errors",
            Self::NothingToEstimate => "there is nothing to estimate",
            Self::MaxIterations => "not converged: the maximum number of iterations was reached",
            Self::TimeLimit => "not converged: the time limit was reached",
            Self::Interrupted => "not converged: interrupted",
            Self::Stalled => {
                "not converged: no step decreases the cost as the derivatives predict; check the derivatives, or use other start values"
            }
            Self::NotDifferentiable(failure) => {
                return write!(f, "not converged: the derivatives do not exist at the last values: {failure}");
            }
        })
    }
}

/// One iteration: a step computed and tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Iteration {
    /// Cost before the step.
    pub cost: f64,
    /// Cost after the step; infinite if the factors could not be evaluated there or no step was found.
    pub trial_cost: f64,
    /// Decrease of the cost that the linear model predicts.
    pub predicted: f64,
    /// max |g_j| before the step.
    pub gradient: f64,
    /// max |δ_j| √H_jj: the largest change of the residuals' norm by one component of the step.
    pub step: f64,
    /// μ of Levenberg–Marquardt, the radius Δ of the dog-leg, or the fraction of the full step of Gauss–Newton.
    pub damping: f64,
    /// Whether the step was accepted.
    pub accepted: bool,
}

/// Seconds spent in each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StageSeconds {
    /// Choice of the linear solver, symbolic factorisation and allocation of memory; once.
    pub structure: f64,
    /// Residuals, Jacobians and their accumulation into normal equations.
    pub linearize: f64,
    /// Elimination, factorisation and solution of the linear system.
    pub linear_solve: f64,
    /// Residuals at trial steps.
    pub evaluate: f64,
    /// Total, all of the above and the rest.
    pub total: f64,
}

/// The course and the outcome of a minimisation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// ½ Σ ρ(‖r‖²) at the start.
    pub cost0: f64,
    /// ½ Σ ρ(‖r‖²) at the end.
    pub cost: f64,
    /// Number of iterations, including those whose step was rejected.
    pub iterations: usize,
    /// Why the solver stopped.
    pub termination: Termination,
    /// Whether the values are a minimum.
    pub converged: bool,
    /// Every iteration.
    pub trace: Vec<Iteration>,
    /// Seconds spent in each stage.
    pub seconds: StageSeconds,
    /// The linear solver that was used.
    pub linear_solver: LinearSolverUsed,
    /// Number of scalar residuals.
    pub residuals: usize,
    /// Number of free tangent components.
    pub unknowns: usize,
    /// The component with the smallest relative pivot in the last factorisation. `None` with conjugate gradients and QR,
    /// which have no pivots.
    pub weakest: Option<Weakest>,
    /// Combinations of variables that the residuals do not determine at the final values, if
    /// [`Options::name_undetermined`](crate::Options::name_undetermined) is set.
    pub undetermined: Vec<NullDirection>,
}

/// The component whose effect on the residuals the other components come closest to reproducing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Weakest {
    /// The variable.
    #[serde(skip)]
    pub variable: VariableId,
    /// Its label.
    pub label: String,
    /// Tangent component.
    pub component: usize,
    /// Its pivot: the diagonal entry of H + μ D² after elimination of the components before it, relative to that of D².
    pub pivot: f64,
    /// μ.
    pub damping: f64,
    /// Whether the pivot is small enough to be due to the damping and rounding errors alone. Then a combination of variables
    /// that involves this component may not be determined. This is only a hint, at no cost; for certainty set
    /// [`Options::name_undetermined`](crate::Options::name_undetermined).
    pub suspect: bool,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.termination)?;
        writeln!(f, "cost {:.9e} -> {:.9e} in {} iterations", self.cost0, self.cost, self.iterations)?;
        writeln!(f, "{} residuals, {} unknowns; {}", self.residuals, self.unknowns, self.linear_solver)?;
        let estimates = &self.linear_solver.estimates;
        if !estimates.is_empty() {
            let listed: Vec<_> = estimates.iter().map(|e| format!("{} {:.1e}", e.solver, e.cost)).collect();
            writeln!(f, "estimated operations: {}", listed.join("; "))?;
        }
        for direction in &self.undetermined {
            writeln!(f, "not determined: {direction}")?;
        }
        if let Some(w) = self.weakest.as_ref().filter(|w| w.suspect && self.undetermined.is_empty()) {
            let (label, component, pivot, damping) = (&w.label, w.component, w.pivot, w.damping);
            writeln!(f, "{label}[{component}] may not be determined: pivot {pivot:.1e}, damping {damping:.1e}")?;
        }
        writeln!(f, "{:>4} {:>15} {:>11} {:>11} {:>11} {:>9}", "", "cost", "gradient", "step", "damping", "")?;
        for (i, it) in self.trace.iter().enumerate() {
            let verdict = if it.accepted { "" } else { "rejected" };
            let (cost, gradient, step, damping) = (it.trial_cost, it.gradient, it.step, it.damping);
            writeln!(f, "{:>4} {cost:>15.9e} {gradient:>11.3e} {step:>11.3e} {damping:>11.3e} {verdict:>9}", i + 1)?;
        }
        let s = &self.seconds;
        write!(
            f,
            "{:.6} s: structure {:.6}, linearize {:.6}, linear solve {:.6}, evaluate {:.6}",
            s.total, s.structure, s.linearize, s.linear_solve, s.evaluate
        )
    }
}
