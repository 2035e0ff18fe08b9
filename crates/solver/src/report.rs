//! What a solver tells about its work.

use std::fmt;

use argmin::core::TerminationReason;
use serde::{Deserialize, Serialize};

use crate::covariance::NullDirection;
use crate::options::LinearSolverUsed;
use crate::values::VariableId;

/// Why a solver stopped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Termination {
    /// The gradient vanishes.
    Gradient,
    /// The cost no longer falls.
    Cost,
    /// The variables no longer move.
    Parameters,
    /// The cost is at its minimum as far as rounding lets one see.
    Rounding,
    /// There is no free variable or no factor.
    NothingToEstimate,
    /// The iterations were used up.
    MaxIterations,
    /// The time was used up.
    TimeLimit,
    /// Interrupted by the user.
    Interrupted,
    /// No step decreases the cost although the linear model promises it; derivatives may be wrong.
    Stalled,
    /// The factors can be evaluated at the last values, but not differentiated.
    NotDifferentiable(String),
}

impl Termination {
    /// Whether the values are a minimum.
    pub fn converged(&self) -> bool {
        matches!(self, Self::Gradient | Self::Cost | Self::Parameters | Self::Rounding | Self::NothingToEstimate)
    }

    /// The same in argmin's terms.
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
            Self::Cost => "converged: the relative decrease of the cost is within its tolerance",
            Self::Parameters => "converged: the step is within the parameter tolerance",
            Self::Rounding => "converged: the cost cannot be decreased beyond rounding errors",
            Self::NothingToEstimate => "there is nothing to estimate",
            Self::MaxIterations => "not converged: the largest number of iterations was reached",
            Self::TimeLimit => "not converged: the time limit was reached",
            Self::Interrupted => "not converged: interrupted",
            Self::Stalled => {
                "not converged: no step decreases the cost as the derivatives promise; check them, or start elsewhere"
            }
            Self::NotDifferentiable(failure) => {
                return write!(f, "not converged: the derivatives do not exist at the last values: {failure}");
            }
        })
    }
}

/// One iteration: a linear system solved and a step tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Iteration {
    /// Cost before the step.
    pub cost: f64,
    /// Cost after the step; infinite where the factors could not be evaluated or no step was found.
    pub trial_cost: f64,
    /// Decrease that the linear model predicts.
    pub predicted: f64,
    /// max |g_j| before the step.
    pub gradient: f64,
    /// max |δ_j| √H_jj: the largest change of the residuals by one component of the step.
    pub step: f64,
    /// μ; the radius Δ of a dog-leg; the share of the whole step of Gauss–Newton.
    pub damping: f64,
    /// Whether the step was taken.
    pub accepted: bool,
}

/// Seconds spent in each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StageSeconds {
    /// Choice of the linear solver, memory layout, symbolic factorisation; once.
    pub structure: f64,
    /// Residuals, Jacobians and their accumulation into normal equations.
    pub linearize: f64,
    /// Elimination, factorisation and solution.
    pub linear_solve: f64,
    /// Residuals at trial steps.
    pub evaluate: f64,
    /// All of the solver, structure included.
    pub total: f64,
}

/// What happened during a minimisation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// ½ Σ ρ(‖r‖²) at the start.
    pub cost0: f64,
    /// ½ Σ ρ(‖r‖²) at the end.
    pub cost: f64,
    /// Number of iterations, rejected steps included.
    pub iterations: usize,
    /// Why the solver stopped.
    pub termination: Termination,
    /// Whether the values are a minimum.
    pub converged: bool,
    /// Each iteration.
    pub trace: Vec<Iteration>,
    /// Seconds spent in each stage.
    pub seconds: StageSeconds,
    /// The linear solver that was chosen.
    pub linear_solver: LinearSolverUsed,
    /// Number of scalar residuals.
    pub residuals: usize,
    /// Number of free tangent components.
    pub unknowns: usize,
    /// The component with the smallest pivot of the last factorisation. Nothing with conjugate gradients and QR, which have
    /// no pivots.
    pub weakest: Option<Weakest>,
    /// Combinations of variables that the residuals do not determine at the end, if
    /// [`Options::name_undetermined`](crate::Options::name_undetermined) asks for them.
    pub undetermined: Vec<NullDirection>,
}

/// A component whose share of the linear system the other components nearly explain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Weakest {
    /// The variable.
    #[serde(skip)]
    pub variable: VariableId,
    /// Its label.
    pub label: String,
    /// Tangent component.
    pub component: usize,
    /// What eliminating the components before it left of its diagonal entry of H + μ D², relative to that of D².
    pub pivot: f64,
    /// μ.
    pub damping: f64,
    /// Whether the pivot is so small that it may be due to the damping and rounding errors alone: then some combination of
    /// variables with this component may not be determined. A hint that costs nothing;
    /// [`Options::name_undetermined`](crate::Options::name_undetermined) finds out.
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
