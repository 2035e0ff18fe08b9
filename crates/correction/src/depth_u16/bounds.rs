//! Bounds on the error of f32, from the coefficients of a chunk and its largest depth.

use crate::bands::CHUNK;
use crate::plan::Moebius;

/// Largest error of a result before it is rounded, steps.
pub(crate) const MOST_ERROR: f32 = 1e-3;

/// Largest coefficients of a Möbius map, chunk by chunk.
#[derive(Debug, Clone)]
pub(crate) struct Bounds {
    chunks: Vec<Bound>,
}

/// Largest coefficients of some pixels: |p|, |q| (mm), |r| (1/mm) and r itself where positive.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Bound {
    p: f32,
    q: f32,
    r: f32,
    r_above: f32,
    /// Whether every valid depth before the pole has a valid result: all pixels have a ray, q = 0 and |p| < 0.4.
    pub keeps_valid: bool,
}

impl Bound {
    /// The bound of two sets of pixels together.
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self {
            p: self.p.max(other.p),
            q: self.q.max(other.q),
            r: self.r.max(other.r),
            r_above: self.r_above.max(other.r_above),
            keeps_valid: self.keeps_valid & other.keeps_valid,
        }
    }

    /// The precision that depths of up to `steps` need. `None` where results may exceed 16 bits, or f64 with
    /// coefficients in f32 is not enough.
    #[inline(always)]
    pub fn needs(self, steps: u16, unit_mm: f32) -> Option<Precision> {
        let Self { p, q, r, r_above, keeps_valid } = self;
        let steps = f32::from(steps);
        let z = steps * unit_mm;
        let left = 1.0 - r_above * z;
        let sum = steps * (p + r * z) + q / unit_mm;
        let change = sum / left;
        let usable = left > 0.05 && steps + change < 65535.0;
        // Depth must not shrink to a half, or a depth of one step would be rounded to 0.
        let kept = !keeps_valid || 1.0 - p > 0.55 * (1.0 + r * z);
        if !(usable && kept) {
            return None;
        }
        // The coefficients are rounded to f32: half an ulp (6e-8) each, that of r magnified near the pole.
        let of_tables = 6e-8 * (steps * p + q / unit_mm + r * z * (steps + change)) / left;
        // The computation rounds by half an ulp each in z, slope, product and sum, twice in the quotient, and once in 1
        // − r z, which is near 1. p, q and r are bounds of absolute values, so this holds where terms cancel.
        let of_f32 = of_tables + 6e-8 * (6.0 * change + (r * z + 1.0) / left * change) + 1e-6;
        match (of_f32 < MOST_ERROR, of_tables < MOST_ERROR) {
            (true, _) => Some(Precision::Single),
            (false, true) => Some(Precision::Double),
            _ => None,
        }
    }
}

/// The precision that a chunk needs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Precision {
    Single,
    Double,
}

impl Bounds {
    /// The bounds of a map over `pixels` pixels.
    pub fn new(map: &Moebius, pixels: usize) -> Self {
        let of_chunk = |first: usize| {
            let c = map.coefficients(first, CHUNK.min(pixels - first));
            let greatest = |values: &[f32]| values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            // Pixels without an inverse (r = 1e30) do not count: they have no result at any depth.
            let poles: Vec<f32> = c.r.iter().copied().filter(|r| *r < 1e29).collect();
            let r_above = poles.iter().copied().fold(0.0, f32::max);
            let p = if c.p.is_empty() { c.p0.abs() } else { greatest(c.p) };
            let keeps_valid = poles.len() == c.r.len() && c.q.is_empty() && p < 0.4;
            Bound { p, q: greatest(c.q), r: greatest(&poles), r_above, keeps_valid }
        };
        Self { chunks: (0..pixels).step_by(CHUNK).map(of_chunk).collect() }
    }

    /// The bound of `length` pixels from `first` on, which is the first pixel of a chunk.
    #[inline(always)]
    pub fn of(&self, first: usize, length: usize) -> Bound {
        let chunks = &self.chunks[first / CHUNK..(first + length).div_ceil(CHUNK)];
        chunks.iter().fold(Bound { keeps_valid: true, ..Bound::default() }, |bound, chunk| bound.and(*chunk))
    }
}
