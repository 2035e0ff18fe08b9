//! Options of the nonlinear solvers.

use std::path::PathBuf;
use std::time::Duration;

use crate::plan::linear_solver::LinearSolver;
use crate::step::error::SolveError;
use crate::step::interrupt::Interrupt;

/// The method that computes steps from the normal equations H δ = −g.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Levenberg–Marquardt: (H + μ D²) δ = −g, with μ controlled by [`Options::damping`].
    #[default]
    LevenbergMarquardt,
    /// Powell's dog-leg between the scaled gradient and the Gauss–Newton step, within the trust region ‖D δ‖ ≤ Δ (Powell
    /// 1970). After a rejected step no new linear solve is needed.
    DogLeg {
        /// Δ at the start. A step of length √(2 · cost) changes the residuals by about their own norm.
        radius: f64,
    },
    /// Gauss–Newton steps, halved until the cost falls. A singular H gets the least damping that makes it positive definite.
    GaussNewton,
}

/// Damping of the Levenberg–Marquardt step (H + μ D²) δ = −g.
///
/// After an accepted step both rules multiply μ by 1 − (2 ρ − 1)³, where ρ is the gain ratio, or by a lower limit (Nielsen
/// 1999); after rejected steps by 2, 4, 8, ….
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Damping {
    /// μ starts at `tau` times the largest diagonal entry of the scaled H (Nielsen 1999): 1e-6 for good start values, up
    /// to 1 for doubtful ones. An accepted step multiplies it by at least 0.1, which saves iterations close to the
    /// minimum. D² holds the largest diagonal entries of H so far (Moré 1978) or is the identity, according to
    /// [`Options::scaling`].
    Nielsen {
        /// τ.
        tau: f64,
    },
    /// No damping beyond rounding errors, hence Gauss–Newton steps, until a step fails; then μ as with
    /// [`Nielsen`](Self::Nielsen), beginning at `tau`, until accepted steps have brought it below `tau` again. For start values
    /// that deserve trust, such as those of [`chordal_start`](crate::pose_graph::chordal_start).
    WhenNeeded {
        /// τ.
        tau: f64,
    },
    /// μ is the inverse of a trust-region radius, D² the current diagonal of H, and an accepted step multiplies μ by at
    /// least 1/3, as in Ceres: more cautious far from the minimum.
    Radius {
        /// Radius at the start.
        initial: f64,
        /// Largest radius.
        max: f64,
    },
}

impl Default for Damping {
    fn default() -> Self {
        Damping::Nielsen { tau: 1e-4 }
    }
}

/// Scaling D of the tangent components, which makes components of different units comparable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scaling {
    /// The norms of the Jacobian's columns, the largest so far (Moré 1978). Steps do not depend on units.
    #[default]
    Jacobi,
    /// No scaling: D = I.
    None,
}

/// Options of the nonlinear solvers.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Maximum number of iterations; each tries one step. Default 100.
    pub max_iterations: u64,
    /// Converged when max |g_j| is at most this, where g is the gradient of the cost. Absolute, hence small. Default 1e-10.
    pub gradient_tolerance: f64,
    /// Converged when a step decreases the cost by at most this, relative to the cost. Default 1e-9.
    pub cost_tolerance: f64,
    /// Converged when a step decreases the cost by at most this. With whitened residuals a decrease of ½ is a move by one
    /// standard deviation, of which statistics need a small part only. Default 0.
    pub decrease_tolerance: f64,
    /// Converged when no component of a step changes the residuals by more than this, relative to their norm:
    /// max |δ_j| √H_jj ≤ tolerance · √(2 · cost). It does not depend on the units of the variables. Default 1e-9.
    pub parameter_tolerance: f64,
    /// A step is accepted if its gain ratio, the decrease of the cost over that predicted by the linear model, exceeds this.
    /// Default 1e-3.
    pub min_gain_ratio: f64,
    /// Method that computes the steps.
    pub method: Method,
    /// Rule for the damping of Levenberg–Marquardt.
    pub damping: Damping,
    /// Scaling of the tangent components.
    pub scaling: Scaling,
    /// Solver of the linear system in each iteration.
    pub linear_solver: LinearSolver,
    /// Number of threads; 0 for those of the rayon pool in which the solver is called. Results are bitwise identical for any
    /// number.
    pub threads: usize,
    /// Stop after this time and return the best values so far.
    pub time_limit: Option<Duration>,
    /// Stop at Ctrl-C and return the best values so far. The handler can be installed only once per process. Default false.
    pub ctrlc: bool,
    /// Stop when this flag is raised, and return the best values so far.
    pub interrupt: Option<Interrupt>,
    /// At the minimum, look for combinations of variables that the residuals do not determine, and list them in
    /// [`Report::undetermined`](crate::Report::undetermined). This takes a factorisation and some solves. Default false:
    /// [`Report::weakest`](crate::Report::weakest) costs nothing and hints at whether there are any.
    pub name_undetermined: bool,
    /// File in which [`minimize`](crate::minimize) saves its state, and from which it resumes when called again.
    pub checkpoint: Option<CheckpointOptions>,
}

/// A [`CheckpointFile`](crate::CheckpointFile) that [`minimize`](crate::minimize) writes, and resumes from if it exists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckpointOptions {
    /// The file.
    pub path: PathBuf,
    /// Number of iterations between two writes, at least 1.
    pub every: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            gradient_tolerance: 1e-10,
            cost_tolerance: 1e-9,
            decrease_tolerance: 0.0,
            parameter_tolerance: 1e-9,
            min_gain_ratio: 1e-3,
            method: Method::default(),
            damping: Damping::default(),
            scaling: Scaling::default(),
            linear_solver: LinearSolver::default(),
            threads: 0,
            time_limit: None,
            ctrlc: false,
            interrupt: None,
            name_undetermined: false,
            checkpoint: None,
        }
    }
}

impl Options {
    /// Checks the ranges of all options.
    pub(crate) fn check(&self) -> Result<(), SolveError> {
        let bad = |option, value: f64, expected: &str| SolveError::Option {
            option,
            reason: format!("{value} is out of range; it must be {expected}"),
        };
        let tolerances = [
            ("gradient_tolerance", self.gradient_tolerance),
            ("cost_tolerance", self.cost_tolerance),
            ("decrease_tolerance", self.decrease_tolerance),
            ("parameter_tolerance", self.parameter_tolerance),
        ];
        for (name, value) in tolerances {
            if value.is_nan() || value < 0.0 {
                return Err(bad(name, value, "0 or more"));
            }
        }
        if !(0.0..1.0).contains(&self.min_gain_ratio) {
            return Err(bad("min_gain_ratio", self.min_gain_ratio, "at least 0 and less than 1"));
        }
        if let Method::DogLeg { radius } = self.method
            && !(radius > 0.0 && radius.is_finite())
        {
            return Err(bad("method.radius", radius, "positive and finite"));
        }
        if self.checkpoint.as_ref().is_some_and(|c| c.every == 0) {
            return Err(bad("checkpoint.every", 0.0, "at least 1"));
        }
        match self.damping {
            Damping::Nielsen { tau } | Damping::WhenNeeded { tau } if !(tau > 0.0 && tau.is_finite()) => {
                Err(bad("damping.tau", tau, "positive and finite"))
            }
            Damping::Radius { initial, .. } if !(initial > 0.0 && initial.is_finite()) => {
                Err(bad("damping.initial", initial, "positive and finite"))
            }
            Damping::Radius { max, initial } if max.is_nan() || max < initial => {
                Err(bad("damping.max", max, "at least damping.initial"))
            }
            _ => Ok(()),
        }
    }
}
