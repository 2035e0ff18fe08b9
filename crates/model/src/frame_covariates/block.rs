//! Blocks of pixels whose light is summed.

use super::modulation::FREQUENCIES;

/// Side of a block, px: small against [`SPREAD_PX`](super::SPREAD_PX).
pub const BLOCK_PX: usize = 16;

/// Sums over a block of pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BlockSum {
    /// Of the phasors of pixels with a range, each as long as the pixel's amplitude.
    pub phasors: [[f32; 2]; FREQUENCIES],
    /// Of the amplitudes of these pixels.
    pub measured: f32,
    /// Of the amplitudes of all pixels.
    pub amplitude: f32,
}
