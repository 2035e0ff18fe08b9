//! Errors of pose graphs.

use thiserror::Error;

use crate::step::error::SolveError;

/// A pose graph cannot be started or certified.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PoseGraphError {
    /// The information of a measurement does not determine a translation or a rotation.
    #[error(
        "the {part} of the relative pose of {to} from {from} has singular information; give it a positive definite one"
    )]
    Singular {
        /// Index of the pose whose frame it is.
        from: usize,
        /// Index of the pose that is seen.
        to: usize,
        /// "translation" or "rotation".
        part: &'static str,
    },
    /// A measurement refers to a pose that does not exist, or to one pose twice.
    #[error("a relative pose of {to} from {from} is none between two of {count} poses")]
    Ends {
        /// Index of the pose whose frame it is.
        from: usize,
        /// Index of the pose that is seen.
        to: usize,
        /// Number of poses.
        count: usize,
    },
    /// No chain of measurements connects a pose to the first one.
    #[error("no chain of relative poses connects pose {pose} to the first one; treat the parts as graphs of their own")]
    Disconnected {
        /// The lowest index of such a pose.
        pose: usize,
    },
    /// A measurement or a pose has a component that is not finite, or a linear system could not be factorised.
    #[error("the linear system of {part} has no solution; check that measurements and poses are finite")]
    Linear {
        /// "rotations", "translations" or "the certificate".
        part: &'static str,
    },
    /// The translations could not be solved for.
    #[error(transparent)]
    Solve(#[from] SolveError),
}
