//! Uncertainty of an estimate: covariances from the normal equations at the minimum, and the combinations of variables that
//! the residuals leave undetermined.

pub(crate) mod covariance;
pub(crate) mod error;
pub(crate) mod gram_schmidt;
pub(crate) mod inverse;
pub(crate) mod linearized;
pub(crate) mod null_direction;
pub(crate) mod null_space;
pub(crate) mod selected;
pub(crate) mod undetermined;
