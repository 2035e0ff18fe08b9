//! Blocks of residuals that are evaluated together, one in each lane of vector registers.

use crate::problem::error::EvaluationError;
use crate::problem::values::Values;

/// Residuals in a block.
///
/// Several vectors of the widest instruction set: the compiler makes vector instructions of a loop over so many factors, since it
/// may then compare pointers first, and leaves the last few to scalar ones.
pub const LANES: usize = 64;

/// Residuals from which a group is evaluated in blocks.
pub(crate) const FEWEST: usize = 16;

/// Residuals in the block that begins with residual `first` of `count`.
#[inline(always)]
pub(crate) fn used_lanes(count: usize, first: usize) -> usize {
    count.saturating_sub(first).min(LANES)
}

/// One number for each residual of a block: a component of the residual or an entry of its Jacobian.
pub type Lane = [f64; LANES];

/// The solver's access to a batch that evaluates its residuals in blocks.
pub trait LaneAccess {
    /// Writes the blocks of a group. A block has M lanes with the rows of the whitened residuals and, if `jacobian` is true, the
    /// lanes of their Jacobian, row-major M × columns. Eight numbers at a time are used of a lane: those beyond the group's last
    /// residual are zero.
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
