//! Correction that is a Möbius map of depth at every pixel.
//!
//! A piece that is affine in inverse depth (ρ_m = a + b ρ) or in depth (z_m = m z + c) has an inverse of the form
//! z = (A z_m + B) / (C z_m + D), and so has any stack of them. Divided by D it reads
//!
//! z = z_m + (z_m (p + r z_m) + q) / (1 − r z_m),   p = A/D − 1, q = B/D, r = −C/D.
//!
//! The change of depth is computed rather than depth itself: it is small, so that the roundings of f32 matter less.

use rayon::prelude::*;

use crate::simd::{Aligned, Isa};

/// A 2×2 matrix [A, B, C, D]: z ↦ (A z + B) / (C z + D).
pub(crate) type Matrix = [f64; 4];

pub(crate) const IDENTITY: Matrix = [1.0, 0.0, 0.0, 1.0];

/// The matrix of "first `inner`, then `outer`".
pub(crate) fn compose([a, b, c, d]: Matrix, [e, f, g, h]: Matrix) -> Matrix {
    [a * e + b * g, a * f + b * h, c * e + d * g, c * f + d * h]
}

/// p, q (mm), r (1/mm) of the formula above. For a map that falls with depth or is undefined, [`NO_INVERSE`].
pub(crate) fn coefficients([a, b, c, d]: Matrix) -> [f64; 3] {
    let rising = a * d - b * c > 0.0;
    let [p, q, r] = [a / d - 1.0, b / d, -c / d];
    if rising && [p, q, r].iter().all(|k| k.abs() < 1e9) { [p, q, r] } else { NO_INVERSE }
}

/// Smallest 1 − r z that f32 can resolve. Below it, rounding decides on which side of the pole (where true depth is
/// infinite) a depth lies, and the pixel is inverted in f64.
pub(crate) const NEAREST_POLE: f32 = 1e-6;

/// Coefficients with which no depth has a result: every depth lies beyond the pole (1 − r z < 0), and where r is not
/// stored, z = 0.
const NO_INVERSE: [f64; 3] = [-1.0, 0.0, 1e30];

/// Pixels whose matrices are computed together.
const BAND: usize = 4096;

/// The coefficients of all pixels. `q` and `r` are empty where they are 0 at all pixels, `p` where it is the same at
/// all pixels.
#[derive(Debug, Clone, Default)]
pub(crate) struct Moebius {
    /// p of all pixels, where `p` is empty.
    pub p_everywhere: f32,
    p: Aligned,
    q: Aligned,
    r: Aligned,
    /// (dx, dy, dz), where r = dx x + dy y + dz at every pixel with the ray (x, y): code that reads the rays anyway
    /// computes r from them instead of reading its table.
    pub r_from_ray: Option<[f32; 3]>,
}

/// The coefficients that are stored as tables. Each case has a loop of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tables {
    /// r alone, e.g. the projective model.
    Pole,
    /// p alone, e.g. a multiplier map.
    Scale,
    /// p and r, e.g. a spline of offset and scale of inverse depth.
    ScaleAndPole,
    /// p, q and r, e.g. an offset of depth followed by another piece.
    All,
}

impl Moebius {
    /// Tables from a matrix for every pixel that has a ray: `matrices` gives those of the pixels with the given indices. `rays`
    /// are the true rays of the pixels, NaN where there is none.
    pub fn new(matrices: impl Fn(&[usize]) -> Vec<Matrix> + Sync, rays: &[[f64; 2]]) -> Self {
        let mut all = vec![NO_INVERSE; rays.len()];
        all.par_chunks_mut(BAND).zip(rays.par_chunks(BAND)).enumerate().for_each(|(band, (all, rays))| {
            let first = band * BAND;
            let seen: Vec<usize> = (first..first + rays.len()).filter(|i| !rays[i - first][0].is_nan()).collect();
            for (i, matrix) in seen.iter().zip(matrices(&seen)) {
                all[i - first] = coefficients(matrix);
            }
        });
        let usable = |c: &&[f64; 3]| **c != NO_INVERSE;
        let Some(&[p0, ..]) = all.iter().find(usable) else { return Self::from_all(&all, [true; 3]) };
        let same_p = all.iter().filter(usable).all(|c| (c[0] - p0).abs() <= 1e-12);
        let q = all.iter().filter(usable).any(|c| c[1].abs() > 1e-9);
        // A smaller r changes a depth of 60 m by less than a thousandth of a millimetre.
        let r = all.iter().filter(usable).any(|c| c[2].abs() > 1e-13);
        let mut map = match (same_p, q) {
            (true, false) => Self { p_everywhere: p0 as f32, ..Self::from_all(&all, [false, false, true]) },
            (false, false) => Self::from_all(&all, [true, false, r]),
            _ => Self::from_all(&all, [true; 3]),
        };
        if map.tables() == Tables::Pole {
            map.r_from_ray = affine_in_ray(&all, rays);
        }
        map
    }

    /// The map with tables of those of p, q, r that are `needed`.
    fn from_all(all: &[[f64; 3]], needed: [bool; 3]) -> Self {
        let table = |k: usize| if needed[k] { all.iter().map(|c| c[k] as f32).collect() } else { Aligned::default() };
        Self { p: table(0), q: table(1), r: table(2), ..Self::default() }
    }

    /// The coefficients that are stored as tables.
    pub fn tables(&self) -> Tables {
        match (self.p.is_empty(), self.q.is_empty(), self.r.is_empty()) {
            (true, true, _) => Tables::Pole,
            (false, true, true) => Tables::Scale,
            (false, true, false) => Tables::ScaleAndPole,
            _ => Tables::All,
        }
    }

    /// The coefficients of `length` pixels from `first` on.
    pub fn coefficients(&self, first: usize, length: usize) -> Coefficients<'_> {
        Coefficients { p0: self.p_everywhere, p: &self.p, q: &self.q, r: &self.r }.part(first, length)
    }
}

/// Coefficients of consecutive pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coefficients<'a> {
    /// p of all pixels, where `p` is empty.
    pub p0: f32,
    pub p: &'a [f32],
    pub q: &'a [f32],
    pub r: &'a [f32],
}

impl Coefficients<'_> {
    /// Those of `length` pixels from `first` on.
    #[inline(always)]
    pub fn part(self, first: usize, length: usize) -> Self {
        fn part(table: &[f32], first: usize, length: usize) -> &[f32] {
            if table.is_empty() { table } else { &table[first..first + length] }
        }
        let [p, q, r] = [self.p, self.q, self.r].map(|table| part(table, first, length));
        Self { p0: self.p0, p, q, r }
    }

    /// Those of the first `n` pixels; P, Q and R tell which coefficients are tables.
    #[inline(always)]
    pub fn first<const P: bool, const Q: bool, const R: bool>(self, n: usize) -> Self {
        let p = if P { &self.p[..n] } else { self.p };
        let q = if Q { &self.q[..n] } else { self.q };
        let r = if R { &self.r[..n] } else { self.r };
        Self { p0: self.p0, p, q, r }
    }

    /// (p, q, r) of pixel `i`.
    #[inline(always)]
    pub fn at<const P: bool, const Q: bool, const R: bool>(self, i: usize) -> (f32, f32, f32) {
        (if P { self.p[i] } else { self.p0 }, if Q { self.q[i] } else { 0.0 }, if R { self.r[i] } else { 0.0 })
    }
}

/// (dx, dy, dz) with r = dx x + dy y + dz at all pixels that have a ray; `None` where r is no such function.
fn affine_in_ray(all: &[[f64; 3]], rays: &[[f64; 2]]) -> Option<[f32; 3]> {
    let pixels = || all.iter().zip(rays).filter(|(_, ray)| !ray[0].is_nan());
    // Normal equations of the plane over the rays. They are well conditioned, since rays span about 1.
    let (mut h, mut g) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
    for (c, [x, y]) in pixels().step_by(1 + all.len() / 5000) {
        let row = nalgebra::Vector3::new(*x, *y, 1.0);
        h += row * row.transpose();
        g += row * c[2];
    }
    let d = h.cholesky()?.solve(&g);
    // A pixel that has a ray but no inverse misses too.
    let misses = |(c, [x, y]): (&[f64; 3], &[f64; 2])| (d.x * x + d.y * y + d.z - c[2]).abs() > 1e-12;
    (!pixels().any(misses)).then_some([d.x as f32, d.y as f32, d.z as f32])
}

/// A loop that is compiled for each case of [`Tables`]; P, Q and R tell whether p, q and r are tables.
pub(crate) trait ForTables {
    type Output;
    fn run<const P: bool, const Q: bool, const R: bool>(self) -> Self::Output;
}

/// Runs the version of a loop that is compiled for `tables`.
#[inline(always)]
pub(crate) fn for_tables<W: ForTables>(tables: Tables, work: W) -> W::Output {
    match tables {
        Tables::Pole => work.run::<false, false, true>(),
        Tables::Scale => work.run::<true, false, false>(),
        Tables::ScaleAndPole => work.run::<true, false, true>(),
        Tables::All => work.run::<true, true, true>(),
    }
}

/// Takes measured to true depth (mm), in place, for consecutive pixels. 0 stays 0; NaN where there is no true depth.
#[inline(always)]
pub(crate) fn correct<I: Isa>(isa: I, tables: Tables, c: Coefficients<'_>, z: &mut [f32]) {
    for_tables(tables, Correct { isa, c, z });
}

struct Correct<'a, I> {
    isa: I,
    c: Coefficients<'a>,
    z: &'a mut [f32],
}

impl<I: Isa> ForTables for Correct<'_, I> {
    type Output = ();

    #[inline(always)]
    fn run<const P: bool, const Q: bool, const R: bool>(self) {
        correct_with::<I, P, Q, R>(self.isa, self.c, self.z);
    }
}

#[inline(always)]
fn correct_with<I: Isa, const P: bool, const Q: bool, const R: bool>(isa: I, c: Coefficients<'_>, z: &mut [f32]) {
    let n = z.len();
    let c = c.first::<P, Q, R>(n);
    for i in 0..n {
        z[i] = one::<I, Q, R>(isa, c.at::<P, Q, R>(i), z[i]);
    }
}

/// The formula at the head of this file for one pixel: 0 stays 0, and NaN where there is no true depth.
#[inline(always)]
fn one<I: Isa, const Q: bool, const R: bool>(isa: I, coefficients: (f32, f32, f32), z: f32) -> f32 {
    let (corrected, usable) = true_depth::<I, Q, R>(isa, coefficients, z);
    if z > 0.0 { if usable { corrected } else { f32::NAN } } else { z }
}

/// True depth of a measured one, mm, and whether it is valid: before the pole and positive.
#[inline(always)]
pub(crate) fn true_depth<I: Isa, const Q: bool, const R: bool>(
    isa: I,
    (p, q, r): (f32, f32, f32),
    z: f32,
) -> (f32, bool) {
    let slope = if R { isa.mul_add(r, z, p) } else { p };
    let change = if Q { isa.mul_add(z, slope, q) } else { z * slope };
    let left = if R { isa.mul_add(-r, z, 1.0) } else { 1.0 };
    let corrected = z + if R { isa.divide(change, left) } else { change };
    (corrected, (left > NEAREST_POLE) & (corrected > 0.0))
}

/// [`correct`] with q = 0 and r = dx x + dy y + dz computed from x and y of the rays.
#[inline(always)]
pub(crate) fn correct_on_rays<I: Isa>(isa: I, p: f32, [dx, dy, dz]: [f32; 3], rays: [&[f32]; 2], z: &mut [f32]) {
    let n = z.len();
    let [x, y] = rays.map(|r| &r[..n]);
    for i in 0..n {
        let r = isa.mul_add(dx, x[i], isa.mul_add(dy, y[i], dz));
        z[i] = one::<I, false, true>(isa, (p, 0.0, r), z[i]);
    }
}

/// [`correct`] with the same coefficients for all pixels.
#[inline(always)]
pub(crate) fn correct_uniform<I: Isa>(isa: I, [p, q, r]: [f32; 3], z: &mut [f32]) {
    for z in z {
        *z = one::<I, true, true>(isa, (p, q, r), *z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// p, q, r are those of the formula above; a map that falls, or that has no numbers, has none.
    #[test]
    fn maps_that_rise_have_an_inverse() {
        let [a, b, c, d] = [1.02, 5.0, 1e-5, 0.99];
        let [p, q, r] = coefficients([a, b, c, d]);
        assert_eq!([p, q, r], [a / d - 1.0, b / d, -c / d]);
        for falling in [[-1.0, 0.0, 0.0, 1.0], [1.0, 2e5, 1e-5, 1.0], [f64::NAN, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]] {
            assert_eq!(coefficients(falling).map(f64::to_bits), NO_INVERSE.map(f64::to_bits), "{falling:?}");
        }
    }

    #[test]
    fn a_pole_that_is_affine_in_the_ray_is_found() {
        let mut rays: Vec<[f64; 2]> = (0..400).map(|i| [0.03 * f64::from(i % 20), 0.02 * f64::from(i / 20)]).collect();
        rays[7] = [f64::NAN; 2];
        let of_ray = |[x, y]: [f64; 2]| [0.0, 0.0, 1e-5 * x - 2e-5 * y + 3e-5];
        let mut all: Vec<[f64; 3]> = rays.iter().map(|ray| of_ray(*ray)).collect();
        let coefficients = affine_in_ray(&all, &rays).expect("it is affine");
        for (coefficient, expected) in coefficients.into_iter().zip([1e-5, -2e-5, 3e-5]) {
            assert!((coefficient - expected).abs() < 1e-11, "{coefficient} {expected}");
        }
        // A single pixel that is another is enough.
        all[211][2] += 1e-9;
        assert_eq!(affine_in_ray(&all, &rays), None);
    }
}
