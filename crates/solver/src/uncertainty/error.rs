//! Errors of computing a covariance.

use thiserror::Error;

use crate::problem::error::{EvaluationFailure, StructureError};
use crate::uncertainty::null_direction::NullDirection;

/// A covariance cannot be computed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CovarianceError {
    /// Graph and values do not fit together.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// A factor cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] EvaluationFailure),
    /// Some combinations of variables are not determined by the residuals.
    #[error(
        "{} combinations of variables are not determined: {}; fix some of these components, add a prior, or ask for the \
         pseudo-inverse", directions.len(), join(directions)
    )]
    RankDeficient {
        /// A basis of these combinations.
        directions: Vec<NullDirection>,
    },
    /// The eigenvalues or the factorisation of the normal equations failed.
    #[error("the normal equations cannot be inverted: no eigenvalues or no factorisation found; check the Jacobians")]
    Eigenvalues,
}

fn join(directions: &[NullDirection]) -> String {
    let shown: Vec<_> = directions.iter().take(4).map(|d| format!("({d})")).collect();
    let more = if directions.len() > 4 { ", …" } else { "" };
    shown.join(", ") + more
}
