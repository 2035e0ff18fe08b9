//! The solver of the reduced system, one of three kinds, planned for a partition of the variables.

use crate::normal::chunk::Chunk;
use crate::normal::conjugate_gradients::ConjugateGradients;
use crate::normal::qr::Qr;
use crate::normal::reduced_blocks::ReducedBlocks;
use crate::normal::reduced_system::ReducedSystem;
use crate::plan::choice::Choice;
use crate::plan::layout::Layout;
use crate::plan::linear_solver::LinearSolver;
use crate::problem::error::StructureError;

/// The solver of the reduced system.
pub(super) enum Linear {
    /// Cholesky factorisation, dense or sparse.
    Direct(ReducedSystem),
    Iterative(ConjugateGradients),
    /// QR factorisation of the Jacobian; nothing is eliminated.
    Orthogonal(Box<Qr>),
}

/// A solver with the blocks of H that it reads.
pub(super) struct Planned {
    pub linear: Linear,
    pub blocks: ReducedBlocks,
    /// Symbolic analyses that were made.
    pub analyses: usize,
}

impl Linear {
    /// Plans the chosen solver and allocates its memory. A `previous` solver with its blocks is used again if its pattern fits.
    pub fn plan(
        choice: &mut Choice,
        layout: &Layout,
        chunks: &[Chunk],
        previous: Option<(Self, ReducedBlocks)>,
    ) -> Result<Planned, StructureError> {
        let mut blocks = ReducedBlocks::new(layout, chunks);
        let n = layout.kept_dim;
        let mut analyses = usize::from(choice.analysed);
        let linear = match (choice.solver, previous) {
            (LinearSolver::ConjugateGradients(preconditioner), _) => {
                Self::Iterative(ConjugateGradients::new(n, &blocks, chunks, preconditioner))
            }
            (LinearSolver::SparseQr, previous) if n > 0 => {
                let previous = previous.and_then(|(linear, _)| match linear {
                    Self::Orthogonal(qr) => Some(*qr),
                    _ => None,
                });
                let (qr, same_pattern) = Qr::new(n, chunks, previous)?;
                analyses = usize::from(!same_pattern);
                Self::Orthogonal(Box::new(qr))
            }
            (LinearSolver::SparseCholesky | LinearSolver::SparseSchur, previous) if n > 0 => {
                let padded = match previous {
                    Some((Self::Direct(reduced @ ReducedSystem::Sparse(_)), other)) => {
                        blocks.with_structure_of(&other, layout, chunks).map(|padded| (reduced, padded))
                    }
                    _ => None,
                };
                Self::Direct(match padded {
                    Some((reduced, padded)) => {
                        blocks = padded;
                        reduced
                    }
                    None => {
                        analyses = 1;
                        ReducedSystem::sparse(n, &blocks, choice.ordering.take())?
                    }
                })
            }
            _ => Self::Direct(ReducedSystem::dense(n)),
        };
        Ok(Planned { linear, blocks, analyses })
    }

    /// Number of entries of the factor; 0 without one.
    pub fn factor_len(&self) -> usize {
        match self {
            Self::Direct(reduced) => reduced.factor_len(),
            Self::Iterative(_) => 0,
            Self::Orthogonal(qr) => qr.factor_len(),
        }
    }

    /// Whether the factorisation is a sparse one.
    pub fn is_sparse(&self) -> bool {
        matches!(self, Self::Direct(ReducedSystem::Sparse(_)) | Self::Orthogonal(_))
    }
}
