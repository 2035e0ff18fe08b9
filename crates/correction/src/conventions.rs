//! Conventions that all modules share: the order of pixels, the ray of a pixel that has none, a typical depth.

/// The ray of a pixel that sees none: the lens maps no ray to it.
pub(crate) const NO_RAY: [f64; 2] = [f64::NAN; 2];

/// Inverse depth at which the rays of a lens that depends on depth are taken, 1/mm: 1 m, in the middle of what depth
/// cameras measure.
pub(crate) const TYPICAL_RHO: f64 = 1e-3;

/// Column and row of the pixel with a row-major index.
pub(crate) fn pixel(index: usize, width: usize) -> [f64; 2] {
    [(index % width) as f64, (index / width) as f64]
}
