//! Rays as cubics along the rows, which need less memory traffic than a table.
//!
//! As a table of f32, the ray of a pixel takes eight bytes: more than its depth, and a third of all memory traffic of
//! back-projection. A lens bends the rays of sixteen consecutive pixels so little that a cubic for each coordinate is
//! as accurate as f32, and takes two bytes per pixel.

use rayon::prelude::*;

use crate::simd::LANES;

/// Largest deviation of x or y of a ray: 0.00025 mm at 5 m.
const TOLERANCE: f64 = 5e-8;

/// Coefficients of c₀ + c₁ t + c₂ t² + c₃ t³ over sixteen pixels, with t = −7.5 … 7.5 from their middle.
pub(crate) type Cubic = [f32; 4];

/// Cubics of x and y for every sixteen consecutive pixels. NaN where no cubic is accurate enough: where the end of a
/// row lies among the sixteen, or a pixel without a ray.
#[derive(Debug, Clone, Default)]
pub(crate) struct RayCubics(Vec<[Cubic; 2]>);

impl RayCubics {
    /// Fits the rays of all pixels, row-major. Where there is a cubic, its values overwrite the rays in `planes` (x and
    /// y), so that all loops use the same rays.
    pub fn new(rays: &[[f64; 2]], planes: &mut [Vec<f32>; 2]) -> Self {
        let fit = Fit::new();
        let of_block = |rays: &[[f64; 2]]| {
            let rays = rays.first_chunk::<LANES>()?;
            let [x, y] = [0, 1].map(|k| fit.cubic(&rays.map(|ray| ray[k])));
            Some([x?, y?])
        };
        let [x, y] = planes;
        let blocks = rays.par_chunks(LANES).zip(x.par_chunks_mut(LANES)).zip(y.par_chunks_mut(LANES));
        let cubics = blocks.map(|((rays, x), y)| {
            let Some(cubics) = of_block(rays) else { return [[f32::NAN; 4]; 2] };
            for (cubic, plane) in cubics.iter().zip([x, y]) {
                plane.iter_mut().enumerate().for_each(|(i, value)| *value = at(cubic, i));
            }
            cubics
        });
        Self(cubics.collect())
    }

    /// The cubics of `count` pixels from `first` on, which is a multiple of sixteen.
    #[inline(always)]
    pub fn part(&self, first: usize, count: usize) -> &[[Cubic; 2]] {
        &self.0[first / LANES..(first + count).div_ceil(LANES)]
    }
}

/// The value of a cubic at one of the sixteen pixels. Loops must evaluate it in this order, so that they get the same
/// bits.
fn at([c0, c1, c2, c3]: &Cubic, i: usize) -> f32 {
    let t = PLACES[i];
    c3.mul_add(t, *c2).mul_add(t, *c1).mul_add(t, *c0)
}

/// t of the sixteen pixels.
pub(crate) const PLACES: [f32; LANES] = {
    let mut places = [0.0; LANES];
    let mut i = 0;
    while i < LANES {
        places[i] = i as f32 - 0.5 * (LANES - 1) as f32;
        i += 1;
    }
    places
};

/// Least-squares fit over sixteen pixels. Even and odd powers of t are orthogonal there, so that the normal equations
/// are two 2×2 systems, whose inverses are kept.
struct Fit {
    even: [[f64; 2]; 2],
    odd: [[f64; 2]; 2],
}

impl Fit {
    fn new() -> Self {
        let moment = |k: i32| PLACES.iter().map(|t| f64::from(*t).powi(k)).sum::<f64>();
        let inverse = |a: f64, b: f64, c: f64| {
            let det = a * c - b * b;
            [[c / det, -b / det], [-b / det, a / det]]
        };
        Self { even: inverse(moment(0), moment(2), moment(4)), odd: inverse(moment(2), moment(4), moment(6)) }
    }

    /// The cubic through sixteen values; `None` where it deviates at any of them.
    fn cubic(&self, values: &[f64; LANES]) -> Option<Cubic> {
        let sum = |k: i32| values.iter().zip(PLACES).map(|(v, t)| v * f64::from(t).powi(k)).sum::<f64>();
        let solve = |[[a, b], [c, d]]: [[f64; 2]; 2], [s, t]: [f64; 2]| [a * s + b * t, c * s + d * t];
        let ([c0, c2], [c1, c3]) = (solve(self.even, [sum(0), sum(2)]), solve(self.odd, [sum(1), sum(3)]));
        let cubic = [c0, c1, c2, c3].map(|c| c as f32);
        // The tolerance comes on top of the rounding of the value itself to f32. False for NaN.
        let right = |(i, v): (usize, &f64)| (f64::from(at(&cubic, i)) - v).abs() <= TOLERANCE + 6e-8 * v.abs();
        values.iter().enumerate().all(right).then_some(cubic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_of_a_lens_are_cubics_but_at_the_ends_of_rows_and_where_there_are_none() {
        const WIDTH: usize = 136;
        const LOST: usize = 3 * WIDTH + 40;
        let ray = |i: usize| {
            let [x, y] = [(i % WIDTH) as f64 / 400.0 - 0.15, (i / WIDTH) as f64 / 400.0];
            let stretch = 1.0 + 0.2 * (x * x + y * y) + 0.1 * (x * x + y * y).powi(2);
            if i == LOST { [f64::NAN; 2] } else { [x * stretch, y * stretch] }
        };
        let rays: Vec<[f64; 2]> = (0..6 * WIDTH).map(ray).collect();
        let mut planes = [0, 1].map(|k| rays.iter().map(|ray| ray[k] as f32).collect::<Vec<f32>>());
        let before = planes.clone();
        let cubics = RayCubics::new(&rays, &mut planes);
        assert_eq!(cubics.part(0, rays.len()).len(), rays.len().div_ceil(LANES));
        for (b, cubic) in cubics.part(0, rays.len()).iter().enumerate() {
            let pixels = b * LANES..(b + 1) * LANES;
            let crosses = pixels.start % WIDTH + LANES > WIDTH;
            assert_eq!(cubic[0][0].is_nan(), crosses || pixels.contains(&LOST), "{b}");
            for (k, i) in pixels.flat_map(|i| [(0, i), (1, i)]) {
                let (coordinate, expected) = (planes[k][i], rays[i][k]);
                if cubic[0][0].is_nan() {
                    assert_eq!(coordinate.to_bits(), before[k][i].to_bits());
                } else {
                    assert!((f64::from(coordinate) - expected).abs() <= 1e-7 && coordinate == at(&cubic[k], i % LANES));
                }
            }
        }
    }
}
