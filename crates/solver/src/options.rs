//! What the user may choose.

use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;

use crate::error::SolveError;
use crate::interrupt::Interrupt;

/// How steps are made from the normal equations H δ = −g.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Levenberg–Marquardt: (H + μ D²) δ = −g, with μ by [`Options::damping`].
    #[default]
    LevenbergMarquardt,
    /// Powell's dog-leg between the scaled gradient and the Gauss–Newton step, within ‖D δ‖ ≤ Δ (Powell 1970). A rejected
    /// step costs no linear solve.
    DogLeg {
        /// Δ at the start; √(2 · cost) is the length at which residuals change by their own size.
        radius: f64,
    },
    /// Gauss–Newton steps, halved until the cost falls. Where H is singular it is damped as little as it takes.
    GaussNewton,
}

/// Damping of the Levenberg–Marquardt step (H + μ D²) δ = −g.
///
/// After a good step both rules multiply μ by the cubic of the gain ratio of Nielsen 1999, after rejected ones by 2, 4, 8, ….
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Damping {
    /// μ falls to a tenth at most, which saves iterations close to the minimum. It starts at `tau` times the largest diagonal entry of the scaled H (Nielsen 1999); 1e-6 for a good start, up to 1
    /// for a doubtful one. D² holds the largest diagonal entries of H so far (Moré 1978) or is the identity, as
    /// [`Options::scaling`] says.
    Nielsen {
        /// τ.
        tau: f64,
    },
    /// μ is the inverse of a trust-region radius, D² the present diagonal of H, and μ falls to a third at most, as in Ceres:
    /// more cautious far from the minimum.
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

/// How columns of different units are made comparable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scaling {
    /// By the norms of the Jacobian's columns, the largest so far (Moré 1978). Steps do not depend on units.
    #[default]
    Jacobi,
    /// Not at all.
    None,
}

/// How the linear system of an iteration is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum LinearSolver {
    /// The one with the lowest estimated cost.
    #[default]
    Auto,
    /// Cholesky of the whole H as a dense matrix.
    Dense,
    /// Sparse Cholesky of the whole H with approximate minimum degree ordering.
    SparseCholesky,
    /// Schur complement on a block-diagonal group of variables, Cholesky of the rest as a dense matrix.
    DenseSchur,
    /// Schur complement on a block-diagonal group of variables, sparse Cholesky of the rest.
    SparseSchur,
    /// Schur complement on a block-diagonal group of variables that is not formed: conjugate gradients for the rest, to a
    /// relative residual of 1e-10. For problems whose reduced system is too large to factorise.
    ConjugateGradients(Preconditioner),
    /// Sparse QR of the Jacobian itself: does not square its condition number as normal equations do, at several times their
    /// cost. For ill-conditioned problems; never chosen automatically, because the costs do not tell.
    SparseQr,
}

impl std::fmt::Display for LinearSolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Auto => "automatic",
            Self::Dense => "dense Cholesky",
            Self::SparseCholesky => "sparse Cholesky",
            Self::DenseSchur => "Schur complement, dense",
            Self::SparseSchur => "Schur complement, sparse",
            Self::ConjugateGradients(Preconditioner::BlockJacobi) => "conjugate gradients, block-Jacobi",
            Self::ConjugateGradients(Preconditioner::SchurJacobi) => "conjugate gradients, Schur-Jacobi",
            Self::SparseQr => "sparse QR",
        })
    }
}

/// What a linear solver was estimated to cost in each iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The linear solver.
    pub solver: LinearSolver,
    /// Floating-point operations, weighted: operations on small blocks, sparse factors and vectors count for more than those
    /// of a dense factorisation. Infinite where the factor would not fit into memory.
    pub cost: f64,
}

/// What makes conjugate gradients converge sooner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Preconditioner {
    /// The diagonal blocks of H, one for each variable: cheap.
    BlockJacobi,
    /// The diagonal blocks of the Schur complement: fewer iterations.
    #[default]
    SchurJacobi,
}

/// The linear solver that was chosen, and why.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LinearSolverUsed {
    /// Which it is; [`LinearSolver::Auto`] before there is one.
    pub solver: LinearSolver,
    /// Whether the options asked for it.
    pub forced: bool,
    /// Estimated costs of those that were compared. Candidates that cannot be cheaper for the size of the problem are not
    /// analysed.
    pub estimates: Vec<Estimate>,
    /// Variables eliminated by the Schur complement, and their dimension.
    pub eliminated_variables: usize,
    /// Their tangent dimension.
    pub eliminated_dim: usize,
    /// Variables in the reduced system.
    pub reduced_variables: usize,
    /// Their tangent dimension.
    pub reduced_dim: usize,
    /// Whether the reduced system is sparse.
    pub sparse: bool,
    /// Whether the reduced system is solved by conjugate gradients, without being formed.
    pub iterative: bool,
    /// Entries of the factors of the reduced system.
    pub factor_entries: usize,
    /// Orderings and symbolic factorisations that were made; 0 where nothing is sparse, or where those of an earlier solution
    /// of the same [`Session`](crate::Session) fitted.
    pub symbolic_analyses: usize,
    /// Parts into which the work is divided for threads.
    pub chunks: usize,
}

impl std::fmt::Display for LinearSolverUsed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kind = match (self.solver, self.iterative, self.sparse) {
            (LinearSolver::SparseQr, ..) => "sparse QR",
            (_, true, _) => "conjugate gradients",
            (_, _, true) => "sparse Cholesky",
            _ => "dense Cholesky",
        };
        let n = self.reduced_dim;
        if self.eliminated_variables == 0 {
            return write!(f, "{kind} of {n} unknowns");
        }
        let (variables, dim) = (self.eliminated_variables, self.eliminated_dim);
        write!(f, "Schur complement on {variables} variables ({dim} unknowns), {kind} of the other {n} unknowns")
    }
}

/// Options of the nonlinear solvers.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Most iterations; each solves one linear system and tries one step. Default 100.
    pub max_iterations: u64,
    /// Converged when max |g_j| is at most this, g the gradient of the cost. Absolute, hence small. Default 1e-10.
    pub gradient_tolerance: f64,
    /// Converged when a step decreases the cost by at most this, relative to the cost. Default 1e-9.
    pub cost_tolerance: f64,
    /// Converged when no component of a step changes the residuals by more than this, relative to them:
    /// max |δ_j| √H_jj ≤ tolerance · √(2 · cost). It does not depend on the units of the variables. Default 1e-9.
    pub parameter_tolerance: f64,
    /// A step is accepted when the cost falls by more than this share of what the linear model predicts. Default 1e-3.
    pub min_gain_ratio: f64,
    /// How steps are made.
    pub method: Method,
    /// Damping rule.
    pub damping: Damping,
    /// Scaling of columns.
    pub scaling: Scaling,
    /// Linear solver.
    pub linear_solver: LinearSolver,
    /// Threads; 0 for those of the thread pool in which the solver is called. Results are the same bits for any number.
    pub threads: usize,
    /// Stop after this time with the best state so far.
    pub time_limit: Option<Duration>,
    /// Stop at Ctrl-C with the best state so far. A process can only do this once. Default false.
    pub ctrlc: bool,
    /// Stop when this flag is raised, with the best state so far.
    pub interrupt: Option<Interrupt>,
    /// Look for combinations of variables that the residuals do not determine once a minimum is found, and name them in
    /// [`Report::undetermined`](crate::Report::undetermined). It takes a factorisation and some solves. Default false:
    /// [`Report::weakest`](crate::Report::weakest) costs nothing and tells whether there may be any.
    pub name_undetermined: bool,
    /// Where [`minimize`](crate::minimize) keeps its state, to go on from there when it is called again.
    pub checkpoint: Option<CheckpointOptions>,
}

/// A [`CheckpointFile`](crate::CheckpointFile) that [`minimize`](crate::minimize) writes, and goes on from if it is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckpointOptions {
    /// The file.
    pub path: PathBuf,
    /// Iterations from one writing to the next, at least 1.
    pub every: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            gradient_tolerance: 1e-10,
            cost_tolerance: 1e-9,
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
    pub(crate) fn check(&self) -> Result<(), SolveError> {
        let bad = |option, value: f64| SolveError::Option { option, reason: format!("{value} is out of range") };
        let tolerances = [
            ("gradient_tolerance", self.gradient_tolerance),
            ("cost_tolerance", self.cost_tolerance),
            ("parameter_tolerance", self.parameter_tolerance),
        ];
        for (name, value) in tolerances {
            if value.is_nan() || value < 0.0 {
                return Err(bad(name, value));
            }
        }
        if !(0.0..1.0).contains(&self.min_gain_ratio) {
            return Err(bad("min_gain_ratio", self.min_gain_ratio));
        }
        if let Method::DogLeg { radius } = self.method
            && !(radius > 0.0 && radius.is_finite())
        {
            return Err(bad("method.radius", radius));
        }
        if self.checkpoint.as_ref().is_some_and(|c| c.every == 0) {
            return Err(bad("checkpoint.every", 0.0));
        }
        match self.damping {
            Damping::Nielsen { tau } if !(tau > 0.0 && tau.is_finite()) => Err(bad("damping.tau", tau)),
            Damping::Radius { initial, .. } if !(initial > 0.0 && initial.is_finite()) => {
                Err(bad("damping.initial", initial))
            }
            Damping::Radius { max, initial } if max.is_nan() || max < initial => Err(bad("damping.max", max)),
            _ => Ok(()),
        }
    }
}
