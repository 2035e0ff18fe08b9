//! The linear solvers to choose from, and the record of the choice.

use serde::Serialize;

/// The method that solves the linear system of an iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum LinearSolver {
    /// The method with the lowest estimated cost.
    #[default]
    Auto,
    /// Cholesky factorisation of the whole H as a dense matrix.
    Dense,
    /// Sparse Cholesky factorisation of the whole H, ordered by approximate minimum degree.
    SparseCholesky,
    /// Elimination of variables that share no factor by a Schur complement; dense Cholesky factorisation of the reduced
    /// system.
    DenseSchur,
    /// Elimination as for [`DenseSchur`](Self::DenseSchur); sparse Cholesky factorisation of the reduced system.
    SparseSchur,
    /// Elimination as for [`DenseSchur`](Self::DenseSchur), without forming the Schur complement; the reduced system is solved by
    /// conjugate gradients to a relative residual of 1e-10. For problems whose reduced system is too large to factorise.
    ConjugateGradients(Preconditioner),
    /// Sparse QR factorisation of the Jacobian. Unlike normal equations it does not square the condition number, at several
    /// times their cost. For ill-conditioned problems; never chosen automatically, because the choice is by cost alone.
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

/// Estimated work of a linear solver per iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorkEstimate {
    /// The linear solver.
    pub solver: LinearSolver,
    /// Weighted floating-point operations: those on small blocks, sparse factors and vectors have higher weights than
    /// those of a dense factorisation. Infinite if the factor would not fit into memory.
    pub cost: f64,
}

/// Preconditioner of conjugate gradients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Preconditioner {
    /// The diagonal blocks of H, one per variable: cheap.
    BlockJacobi,
    /// The diagonal blocks of the Schur complement: fewer iterations.
    #[default]
    SchurJacobi,
}

/// The linear solver that was used, and why.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LinearSolverUsed {
    /// The linear solver; [`LinearSolver::Auto`] before one has been chosen.
    pub solver: LinearSolver,
    /// Whether the options prescribed it.
    pub forced: bool,
    /// Estimates of the linear solvers that were compared. Those that cannot be cheaper, given the size of the problem, are
    /// not analysed.
    pub estimates: Vec<WorkEstimate>,
    /// Number of variables eliminated by the Schur complement.
    pub eliminated_variables: usize,
    /// Sum of their tangent dimensions, fixed components excluded.
    pub eliminated_dim: usize,
    /// Number of variables in the reduced system.
    pub reduced_variables: usize,
    /// Sum of their tangent dimensions, fixed components excluded.
    pub reduced_dim: usize,
    /// Whether the reduced system is sparse.
    pub sparse: bool,
    /// Whether the reduced system is solved by conjugate gradients, without forming it.
    pub iterative: bool,
    /// Number of entries in the factors of the reduced system.
    pub factor_entries: usize,
    /// Number of orderings and symbolic factorisations made: 0 if nothing is sparse, or if those of an earlier solution
    /// of the same [`Session`](crate::Session) were used again.
    pub symbolic_analyses: usize,
    /// Number of chunks into which the work is divided for threads.
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
