//! Blocks of residuals that are evaluated together, one in each lane of a vector register.

use crate::problem::error::EvaluationError;
use crate::problem::values::Values;

/// Residuals in a block.
pub const LANES: usize = 8;

/// One number for each residual of a block: a component of the residual or an entry of its Jacobian.
pub type Lane = [f64; LANES];

/// The solver's access to a batch whose residuals are evaluated in blocks; [`Lanes`](crate::Lanes) implements it.
pub trait LaneAccess {
    /// For each row of a residual the columns, ascending, of the Jacobian's entries that may differ from zero.
    fn pattern(&self) -> &[&'static [u32]];

    /// Writes the blocks of a group, one after the other. A block has M lanes with the rows of the whitened residuals
    /// and, if `jacobian` is true, E lanes with the entries of their Jacobian, row after row as in
    /// [`pattern`](Self::pattern). What is written for residuals beyond the group's last one is ignored.
    ///
    /// # Errors
    /// If the residuals do not exist at these values.
    fn evaluate_lanes(
        &self,
        group: usize,
        values: &Values,
        blocks: &mut [Lane],
        jacobian: bool,
    ) -> Result<(), EvaluationError>;
}
