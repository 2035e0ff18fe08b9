//! One frame's rows of the adjustment: what tests of single frames need.

use nalgebra::{DMatrix, DVector};

/// Whitened residuals and pose columns of a frame: markers first, then depth samples.
pub struct FrameRows {
    /// Residuals, weighted as the adjustment weights them.
    pub residuals: DVector<f64>,
    /// Square roots of the weights that the loss gives the rows.
    pub weights: Vec<f64>,
    /// Six columns of the pose.
    pub pose: DMatrix<f64>,
    /// How many of the rows are depth samples (the last ones).
    pub depth: usize,
}
