//! Correction by a factor that differs from pixel to pixel and is piecewise linear in depth, as in a multiplier map
//! with several bins over depth.
//!
//! z_m = z m(z), where m is linear between nodes of depth and constant before the first and beyond the last. Since z
//! m(z) rises with z, the segment that z lies in starts at the last node with z m(z) ≤ z_m; no search is needed. Within
//! a segment m = α + s z, and z (α + s z) = z_m is solved by Newton's method, started at z_m, which is off by some
//! percent.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::simd::Isa;

/// Most nodes. The time per pixel grows with their number.
const MOST_NODES: usize = 8;
/// Largest deviation of the factor from a linear function that is taken for rounding.
const SAME: f64 = 1e-9;

/// Pixels whose segments are found at a time.
const BLOCK: usize = 256;
/// Newton steps.
const NEWTON_STEPS: usize = 3;
/// Longest last Newton step at which the iteration counts as converged, as a share of the root.
const CONVERGED: f32 = 1e-5;

/// The nodes and, for each node, the factors of all pixels.
#[derive(Debug, Clone)]
pub(crate) struct PiecewiseFactor {
    nodes_mm: Vec<f32>,
    /// 1 / (distance to the next node), 0 at the last.
    per_mm: Vec<f32>,
    factors: Vec<Vec<f32>>,
}

impl PiecewiseFactor {
    /// Factors of a depth piece whose constants `bins`, `near_mm` and `far_mm` give the number of nodes, equally
    /// spaced, and the depths of the first and the last. `measured` maps pixel and true inverse depth (1/mm) to
    /// measured inverse depth; `usable` tells which pixels have a ray. `None` where the constants are missing, or the
    /// piece is not piecewise linear in this way at the pixels `samples`.
    pub fn new(
        options: &BTreeMap<String, f64>,
        measured: &(impl Fn(usize, f64) -> f64 + Sync),
        samples: &[usize],
        pixels: usize,
        usable: impl Fn(usize) -> bool + Sync,
    ) -> Option<Self> {
        let [bins, near, far] = ["bins", "near_mm", "far_mm"].map(|name| options.get(name).copied());
        let (count, near, far) = (bins? as usize, near?, far?);
        let usable_nodes = near > 0.0 && far > near && far < f64::from(f32::MAX);
        if !((2..=MOST_NODES).contains(&count) && usable_nodes) {
            return None;
        }
        let length = (far - near) / (count - 1) as f64;
        let nodes: Vec<f64> = (0..count).map(|b| near + length * b as f64).collect();
        let factor = |pixel: usize, z: f64| 1.0 / (z * measured(pixel, 1.0 / z));
        let linear = |pixel: usize| {
            let at_nodes: Vec<f64> = nodes.iter().map(|z| factor(pixel, *z)).collect();
            let between = at_nodes
                .windows(2)
                .zip(&nodes)
                .flat_map(|(m, z)| [0.21, 0.5, 0.83].map(|t| (z + t * length, m[0] + t * (m[1] - m[0]))));
            let beyond = [(0.4 * near, at_nodes[0]), (2.3 * far, at_nodes[count - 1])];
            between.chain(beyond).all(|(z, m)| (factor(pixel, z) - m).abs() <= SAME)
        };
        if !samples.par_iter().all(|pixel| linear(*pixel)) {
            return None;
        }
        let of_pixel = |pixel: usize| {
            let mut m = [f32::NAN; MOST_NODES];
            let factors: Vec<f64> = nodes.iter().map(|z| factor(pixel, *z)).collect();
            // d(z m)/dz at both ends of a segment. Where z m falls there are several true depths or none.
            let rises = |(m, z): (&[f64], &f64)| {
                let rise = (m[1] - m[0]) / length;
                m[0] + z * rise > 0.0 && m[1] + (z + length) * rise > 0.0
            };
            if usable(pixel) && factors[0] > 0.0 && factors.windows(2).zip(&nodes).all(rises) {
                m.iter_mut().zip(factors).for_each(|(m, factor)| *m = factor as f32);
            }
            m
        };
        let all: Vec<[f32; MOST_NODES]> = (0..pixels).into_par_iter().map(of_pixel).collect();
        let mut per_mm = vec![(1.0 / length) as f32; count];
        per_mm[count - 1] = 0.0;
        Some(Self {
            nodes_mm: nodes.iter().map(|z| *z as f32).collect(),
            per_mm,
            factors: (0..count).map(|b| all.iter().map(|m| m[b]).collect()).collect(),
        })
    }

    /// Takes measured to true depth (mm), in place, for consecutive pixels from `first` on. 0 stays 0; NaN where
    /// Newton's method did not converge.
    #[inline(always)]
    pub fn correct<I: Isa>(&self, isa: I, first: usize, z: &mut [f32]) {
        for (b, z) in z.chunks_mut(BLOCK).enumerate() {
            self.block(isa, first + b * BLOCK, z);
        }
    }

    #[inline(always)]
    fn block<I: Isa>(&self, isa: I, first: usize, z: &mut [f32]) {
        let n = z.len();
        let (mut alpha, mut slope) = ([0.0; BLOCK], [0.0; BLOCK]);
        let (alpha, slope) = (&mut alpha[..n], &mut slope[..n]);
        // Before the first node the factor is constant.
        alpha.copy_from_slice(&self.factors[0][first..first + n]);
        for (b, (node, per_mm)) in self.nodes_mm.iter().zip(&self.per_mm).enumerate() {
            let here = &self.factors[b][first..first + n];
            let next = &self.factors[(b + 1).min(self.factors.len() - 1)][first..first + n];
            for i in 0..n {
                let rise = (next[i] - here[i]) * per_mm;
                let start = isa.mul_add(-rise, *node, here[i]);
                let behind = z[i] >= node * here[i];
                slope[i] = if behind { rise } else { slope[i] };
                alpha[i] = if behind { start } else { alpha[i] };
            }
        }
        for i in 0..n {
            let measured = z[i];
            let (mut depth, mut step) = (measured, 0.0);
            for _ in 0..NEWTON_STEPS {
                let factor = isa.mul_add(slope[i], depth, alpha[i]);
                let missing = isa.mul_add(-depth, factor, measured);
                step = isa.divide(missing, isa.mul_add(slope[i], depth, factor));
                depth += step;
            }
            let converged = step.abs() <= CONVERGED * depth;
            z[i] = if measured > 0.0 { if converged { depth } else { f32::NAN } } else { measured };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Isa, Kernel, dispatch};

    struct Correct<'a>(&'a PiecewiseFactor, &'a mut [f32]);

    impl Kernel for Correct<'_> {
        type Output = ();
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) {
            self.0.correct(isa, 0, self.1);
        }
    }

    fn options(bins: f64) -> BTreeMap<String, f64> {
        [("bins", bins), ("near_mm", 500.0), ("far_mm", 2500.0)].map(|(k, v)| (k.to_owned(), v)).into()
    }

    /// Factors 0.9, 1.1, 0.95 at 500, 1500, 2500 mm.
    fn factor(z: f64) -> f64 {
        let rise = if z < 1500.0 { (z - 500.0).max(0.0) * 2e-4 } else { 0.2 - (z.min(2500.0) - 1500.0) * 1.5e-4 };
        0.9 + rise
    }

    #[test]
    fn undoes_a_factor_between_its_nodes_and_beyond() {
        let measured = |_: usize, rho: f64| rho / factor(1.0 / rho);
        let n = 301;
        let factors = PiecewiseFactor::new(&options(3.0), &measured, &[0], n, |_| true).unwrap();
        let truth: Vec<f64> = (0..n).map(|i| 200.0 + 10.0 * i as f64).collect();
        let mut z: Vec<f32> = truth.iter().map(|z| (z * factor(*z)) as f32).collect();
        z[7] = 0.0;
        dispatch(Correct(&factors, &mut z));
        assert_eq!(z[7], 0.0);
        for (z, truth) in z.iter().zip(&truth).filter(|(z, _)| **z > 0.0) {
            assert!((f64::from(*z) - truth).abs() < 1e-3, "{z} {truth}");
        }
    }

    #[test]
    fn is_refused_where_the_factor_is_another_and_unknown_where_it_has_no_inverse() {
        let measured = |_: usize, rho: f64| rho / factor(1.0 / rho);
        assert!(PiecewiseFactor::new(&BTreeMap::new(), &measured, &[0], 8, |_| true).is_none());
        assert!(PiecewiseFactor::new(&options(4.0), &measured, &[0], 8, |_| true).is_none());
        // From 1 to 0.3 over 1000 mm: z m(z) falls before the second node.
        let falls = |_: usize, rho: f64| rho / (1.0 - 7e-4 * (1.0 / rho - 500.0).clamp(0.0, 2000.0)).max(0.3);
        let two = options(2.0);
        let of_two = |_: usize, rho: f64| rho / (1.0 - 4e-4 * (1.0 / rho - 500.0).clamp(0.0, 2000.0));
        assert!(PiecewiseFactor::new(&two, &falls, &[0], 8, |_| true).is_none());
        let factors = PiecewiseFactor::new(&two, &of_two, &[0], 8, |_| true).unwrap();
        let mut z = [1000.0f32; 8];
        dispatch(Correct(&factors, &mut z));
        assert!(z.iter().all(|z| z.is_nan()));
    }
}
