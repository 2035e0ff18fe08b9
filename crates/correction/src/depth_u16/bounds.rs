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
        let stays_valid = !keeps_valid || 1.0 - p > 0.55 * (1.0 + r * z);
        if !(usable && stays_valid) {
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

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Bound = Bound { p: 0.0, q: 0.0, r: 0.0, r_above: 0.0, keeps_valid: false };

    fn needs(bound: Bound, steps: u16) -> Option<&'static str> {
        bound.needs(steps, 1.0).map(|precision| match precision {
            Precision::Single => "f32",
            Precision::Double => "f64",
        })
    }

    #[test]
    fn results_beyond_sixteen_bits_have_no_precision() {
        // 60 000 · 1.1 = 66 000 steps, 59 000 · 1.1 = 64 900.
        let larger = Bound { p: 0.1, ..NONE };
        assert_eq!((needs(larger, 60_000), needs(larger, 59_000).is_some()), (None, true));
        // 6000 steps more, by the constant.
        let constant = Bound { q: 6000.0, ..NONE };
        assert_eq!((needs(constant, 60_000), needs(constant, 59_000).is_some()), (None, true));
        // 1 − r z is 0.04 and 0.06.
        let pole = |r_above: f32| Bound { r_above, ..NONE };
        assert_eq!((needs(pole(0.96e-3), 1000), needs(pole(0.94e-3), 1000).is_some()), (None, true));
    }

    #[test]
    fn depth_that_could_shrink_to_nothing_has_no_precision() {
        let need = |p: f32, keeps_valid: bool| needs(Bound { p, keeps_valid, ..NONE }, 10);
        assert_eq!((need(0.46, true), need(0.44, true), need(0.46, false)), (None, Some("f32"), Some("f32")));
        // 1 − p = 0.6 > 0.55 (1 + r z) up to r z = 0.09.
        let with_r = |rz: f32| needs(Bound { p: 0.4, r: rz / 10.0, keeps_valid: true, ..NONE }, 10);
        assert_eq!((with_r(0.1), with_r(0.08)), (None, Some("f32")));
    }

    /// Over two chunks, of whose second a pixel is another: that the map keeps valid depth must hold at all pixels.
    #[test]
    fn valid_depth_is_kept_only_where_all_pixels_keep_it() {
        let keeps = |other: [f64; 4], ray: [f64; 2]| {
            let mut rays = vec![[0.1, -0.2]; CHUNK + 9];
            rays[CHUNK + 5] = ray;
            let usual = [1.02, 0.0, -1e-6, 1.0];
            let map =
                Moebius::new(|all| all.iter().map(|i| if *i == CHUNK + 5 { other } else { usual }).collect(), &rays);
            let bounds = Bounds::new(&map, rays.len());
            let [first, both] = [CHUNK, CHUNK + 9].map(|length| bounds.of(0, length).keeps_valid);
            // A map with a constant has one at every pixel.
            assert_eq!(first, other[1] == 0.0);
            both
        };
        let ray = [0.1, -0.2];
        assert!(keeps([1.03, 0.0, -2e-6, 1.0], ray) && keeps([1.39, 0.0, 0.0, 1.0], ray));
        assert!(!keeps([1.41, 0.0, 0.0, 1.0], ray) && !keeps([1.02, 4.0, -1e-6, 1.0], ray));
        assert!(!keeps([1.03, 0.0, -2e-6, 1.0], [f64::NAN; 2]));
    }

    #[test]
    fn larger_changes_need_more_precision() {
        assert_eq!(needs(Bound { p: 0.1, ..NONE }, 1000), Some("f32"));
        // The change is 5000 steps: its roundings, 6 · 6e-8 · 5000, are more than a thousandth of a step; those of the
        // coefficients, 6e-8 · 5000, are less.
        assert_eq!(needs(Bound { p: 0.1, ..NONE }, 50_000), Some("f64"));
        // The change is 0.85 / 0.15 · 176 = 1000 steps, of which f32 would do; but the roundings of 1 − r z are magnified by 1.85
        // / 0.15.
        let near_pole = Bound { r: 0.85 / 176.0, r_above: 0.85 / 176.0, ..NONE };
        assert_eq!(needs(near_pole, 176), Some("f64"));
        // 6e-8 · 20 000 is more than a thousandth.
        assert_eq!(needs(Bound { p: 0.5, ..NONE }, 40_000), None);
    }
}
