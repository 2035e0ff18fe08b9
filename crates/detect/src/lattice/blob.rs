//! Nodes of a lattice before it is known.

/// A candidate for a node of the lattice: a dot, or a saddle point, which has a nominal size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blob {
    /// px
    pub(crate) center: [f64; 2],
    /// Second central moments xx, xy, yy of the region over its area, px². A disc of radius r has r²/4.
    pub(crate) covariance: [f64; 3],
    /// px²
    pub(crate) area: f64,
    /// Grey levels between the dot's darkest value and the level at which it merges with something else.
    pub(crate) contrast: u8,
}

impl Blob {
    /// Length of `d` (px) in units of the dot's radius in that direction, which undoes the tilt of the board.
    pub(crate) fn in_radii(&self, d: [f64; 2]) -> f64 {
        self.dot_product(d, d).max(0.0).sqrt()
    }

    /// Scalar product of two vectors (px) in the metric in which this dot is the unit disc.
    pub(crate) fn dot_product(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let [xx, xy, yy] = self.covariance;
        let det = xx * yy - xy * xy;
        (yy * a[0] * b[0] - xy * (a[0] * b[1] + a[1] * b[0]) + xx * a[1] * b[1]) / (4.0 * det)
    }
}
