//! Tables over the pixels of a row that are smooth, as cubics: what is not read from memory need not be waited for.
//!
//! Rays take eight bytes of a pixel from tables, more than its depth and a third of all that a point moves. A lens bends them so
//! little over sixteen pixels that a cubic for each coordinate is right to some 1e-8, and takes two bytes of a pixel.

use rayon::prelude::*;

use super::simd::LANES;

/// Pixels over which a cubic is right: sixteen from any of the first sixteen on, since blocks of points may begin between.
const SPAN: usize = 2 * LANES - 1;

/// Largest deviation of a ray, which at 5 m is a thousandth of a millimetre.
const TOLERANCE: f64 = 2e-7;

/// c₀ + c₁ t + c₂ t² + c₃ t³ of the pixel t + 15 after the first.
pub(super) type Cubic = [f32; 4];

/// x and y of rays, from every sixteenth pixel on; NaN where they are not cubics: at the end of a row and where pixels
/// have no ray.
#[derive(Debug, Clone, Default)]
pub(super) struct RayCubics(Vec<[Cubic; 2]>);

impl RayCubics {
    /// Of the rays of all pixels, row by row.
    pub fn new(rays: &[[f64; 2]]) -> Self {
        let fit = Fit::new();
        let of_block = |block: &[[f64; 2]]| {
            let Some(span) = block.first_chunk::<SPAN>() else { return NONE };
            let [x, y] = [0, 1].map(|k| fit.cubic(&span.map(|ray| ray[k]), TOLERANCE));
            x.zip(y).map_or(NONE, |(x, y)| [x, y])
        };
        let from = |b: usize| &rays[b * LANES..rays.len().min(b * LANES + SPAN)];
        Self((0..rays.len().div_ceil(LANES)).into_par_iter().map(|b| of_block(from(b))).collect())
    }

    /// Those of some pixels; `first` is a multiple of sixteen.
    #[inline(always)]
    pub fn part(&self, first: usize, count: usize) -> &[[Cubic; 2]] {
        &self.0[first / LANES..(first + count).div_ceil(LANES)]
    }
}

const NONE: [Cubic; 2] = [[f32::NAN; 4]; 2];

/// Least squares over t = −15 … 15: even and odd powers are orthogonal.
struct Fit {
    even: [[f64; 2]; 2],
    odd: [[f64; 2]; 2],
}

impl Fit {
    fn new() -> Self {
        let moment = |k: i32| (0..SPAN).map(|i| place(i).powi(k)).sum::<f64>();
        let inverse = |a: f64, b: f64, c: f64| {
            let det = a * c - b * b;
            [[c / det, -b / det], [-b / det, a / det]]
        };
        Self {
            even: inverse(moment(0), moment(2), moment(4)),
            odd: inverse(moment(2), moment(4), moment(6)),
        }
    }

    /// The cubic of some values, where it is right everywhere.
    fn cubic(&self, values: &[f64; SPAN], tolerance: f64) -> Option<Cubic> {
        let sums = [0, 1, 2, 3].map(|k| values.iter().enumerate().map(|(i, v)| v * place(i).powi(k)).sum::<f64>());
        let solve = |[[a, b], [c, d]]: [[f64; 2]; 2], [s, t]: [f64; 2]| [a * s + b * t, c * s + d * t];
        let ([c0, c2], [c1, c3]) = (solve(self.even, [sums[0], sums[2]]), solve(self.odd, [sums[1], sums[3]]));
        let cubic = [c0, c1, c2, c3].map(|c| c as f32);
        let at = |t: f64| cubic.iter().rev().fold(0.0, |value, c| value * t + f64::from(*c));
        // NaN is not right.
        values.iter().enumerate().all(|(i, v)| (at(place(i)) - v).abs() <= tolerance).then_some(cubic)
    }
}

fn place(i: usize) -> f64 {
    i as f64 - (LANES - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_of_a_lens_are_cubics_but_at_the_ends_of_rows_and_where_there_are_none() {
        const WIDTH: usize = 128;
        let ray = |i: usize| {
            let [x, y] = [(i % WIDTH) as f64 / 400.0 - 0.15, (i / WIDTH) as f64 / 400.0];
            let stretch = 1.0 + 0.2 * (x * x + y * y) + 0.1 * (x * x + y * y).powi(2);
            if i == 3 * WIDTH + 40 { [f64::NAN; 2] } else { [x * stretch, y * stretch] }
        };
        let rays: Vec<[f64; 2]> = (0..6 * WIDTH).map(ray).collect();
        let cubics = RayCubics::new(&rays);
        assert_eq!(cubics.part(0, rays.len()).len(), rays.len() / LANES);
        for (b, [x, y]) in cubics.part(0, rays.len()).iter().enumerate() {
            let first = b * LANES;
            let crosses = first % WIDTH + SPAN > WIDTH;
            let lost = (first..first + SPAN).contains(&(3 * WIDTH + 40));
            assert_eq!(x[0].is_nan(), crosses || lost, "{b}");
            for i in (0..SPAN).filter(|_| !x[0].is_nan()) {
                let at = |c: &Cubic| c.iter().rev().fold(0.0, |value, c| value * place(i) + f64::from(*c));
                let [expected_x, expected_y] = rays[first + i];
                assert!((at(x) - expected_x).abs() <= TOLERANCE && (at(y) - expected_y).abs() <= TOLERANCE);
            }
        }
    }
}
