//! Correction by a general function of pixel and depth, approximated by a short sum of products.
//!
//! At pixel i, measured and true depth differ by a function of true depth, w_m − w = g_i(w), where w is depth or
//! inverse depth. The functions of all pixels are approximated by g_i(w) ≈ Σ_k c_ik φ_k(w) with at most [`MOST_TERMS`]
//! terms. The approximation is exact for a field whose parameters enter linearly, given enough terms.
//!
//! The φ_k are found by empirical interpolation (Barrault, Maday, Nguyen, Patera 2004). In each round, the sampled
//! pixel and depth with the largest error of the sum are found. The error of that pixel, as a function of depth and
//! scaled to 1 at that depth, becomes the next φ; that depth becomes its pivot, at which the next coefficient of every
//! pixel is read off.
//!
//! The inverse solves w + g_i(w) = w_m by Newton's method, with the φ_k and their slopes from tables.

use rayon::prelude::*;

use super::depth_table::{self, Cell, NODES, Values};
use crate::simd::Isa;

/// Most terms.
pub(crate) const MOST_TERMS: usize = 6;
/// Largest error of the sum at sampled pixels, mm of depth.
const TOLERANCE_MM: f64 = 1e-3;
/// Depths between which the sum is fitted, mm; beyond them pixels are inverted in f64.
const RANGE_MM: [f64; 2] = [150.0, 12_000.0];
/// w = SCALE / z where w is inverse depth: this gives w the range of depth in mm, which the tables cover.
const SCALE: f64 = (1u64 << 20) as f64;
/// The sum is compared with the functions at every so many nodes of the tables.
const STRIDE: usize = 48;

/// Coefficients c_ik of all pixels, and the functions φ_k.
#[derive(Debug, Clone)]
pub(crate) struct Separable {
    /// Whether w is inverse depth.
    inverse: bool,
    coefficients: Vec<Vec<f32>>,
    functions: Vec<Box<Values>>,
}

/// A function φ at all nodes, in f64, and its pivot: the node where it is 1.
struct Function {
    values: Vec<f64>,
    pivot: usize,
}

impl Separable {
    /// The sum for `measured`, which maps pixel and true inverse depth (1/mm) to measured inverse depth. The functions
    /// φ are found from the pixels `samples`; `usable` tells which pixels have a ray. w is depth or inverse depth,
    /// whichever needs fewer terms. `None` where [`MOST_TERMS`] are not enough for either.
    pub fn new(
        measured: &(impl Fn(usize, f64) -> f64 + Sync),
        samples: &[usize],
        pixels: usize,
        usable: impl Fn(usize) -> bool + Sync,
    ) -> Option<Self> {
        let both = [true, false].map(|inverse| (inverse, functions(measured, samples, inverse)));
        let (inverse, functions) =
            both.into_iter().filter_map(|(i, f)| Some((i, f?))).min_by_key(|(_, functions)| functions.len())?;
        let of_pixel = |pixel: usize| -> [f64; MOST_TERMS] {
            if usable(pixel) {
                coefficients(&functions, |node| difference(measured, pixel, node, inverse))
            } else {
                [f64::NAN; MOST_TERMS]
            }
        };
        let all: Vec<[f64; MOST_TERMS]> = (0..pixels).into_par_iter().map(of_pixel).collect();
        let coefficients = (0..functions.len()).map(|k| all.iter().map(|c| c[k] as f32).collect()).collect();
        let tables = functions.iter().map(|function| {
            let mut values = depth_table::zeros();
            for (i, value) in values.iter_mut().enumerate() {
                *value = if in_range(i, inverse) { function.values[i] as f32 } else { f32::NAN };
            }
            values
        });
        Some(Self { inverse, coefficients, functions: tables.collect() })
    }

    /// Takes measured to true depth (mm), in place, for consecutive pixels from `first` on. 0 stays 0; NaN where the
    /// tables do not reach or Newton's method did not converge.
    #[inline(always)]
    pub fn correct<I: Isa>(&self, isa: I, first: usize, z: &mut [f32]) {
        match self.functions.len() {
            0 => {}
            1 => self.correct_with::<I, 1>(isa, first, z),
            2 => self.correct_with::<I, 2>(isa, first, z),
            3 => self.correct_with::<I, 3>(isa, first, z),
            4 => self.correct_with::<I, 4>(isa, first, z),
            5 => self.correct_with::<I, 5>(isa, first, z),
            _ => self.correct_with::<I, MOST_TERMS>(isa, first, z),
        }
    }

    #[inline(always)]
    fn correct_with<I: Isa, const K: usize>(&self, isa: I, first: usize, z: &mut [f32]) {
        let n = z.len();
        let mut coefficients: [&[f32]; K] = [&[]; K];
        let mut functions: [&Values; K] = [&self.functions[0]; K];
        for k in 0..K {
            coefficients[k] = &self.coefficients[k][first..first + n];
            functions[k] = &self.functions[k];
        }
        for i in 0..n {
            // Loops, not closures: a closure that is not inlined is compiled for the target's baseline.
            let mut c = [0.0; K];
            for k in 0..K {
                c[k] = coefficients[k][i];
            }
            let measured = z[i];
            let w_m = if self.inverse { SCALE as f32 / measured } else { measured };
            let w = solve(isa, &functions, c, w_m);
            let corrected = if self.inverse { SCALE as f32 / w } else { w };
            z[i] = if measured > 0.0 { corrected } else { measured };
        }
    }
}

/// Newton steps. Measured depth, where they start, is off by some percent at most, and every step squares the error:
/// two would do. The third is for functions with kinks, and its length tells whether the iteration has converged.
const NEWTON_STEPS: usize = 3;
/// Longest last Newton step at which the iteration counts as converged, as a share of w.
const CONVERGED: f32 = 1e-6;

/// The root w of w + g(w) = w_m; NaN where Newton's method did not converge within the tables.
#[inline(always)]
fn solve<I: Isa, const K: usize>(isa: I, functions: &[&Values; K], c: [f32; K], w_m: f32) -> f32 {
    let (mut w, mut step) = (w_m, 0.0);
    let mut inside = true;
    for _ in 0..NEWTON_STEPS {
        let cell = Cell::of(w);
        inside &= cell.inside;
        let (mut value, mut rise) = (0.0, 0.0);
        for k in 0..K {
            let (v, r) = cell.value_and_rise(functions[k]);
            value = isa.mul_add(c[k], v, value);
            rise = isa.mul_add(c[k], r, rise);
        }
        let length = cell.length();
        // w − w_m is small and exact, so that the residual keeps its digits.
        let next = w - ((w - w_m) + value) * length / (length + rise);
        inside &= length + rise > 0.0;
        step = next - w;
        w = next;
    }
    if inside & (step.abs() <= CONVERGED * w) { w } else { f32::NAN }
}

/// Depth (mm) of a node of w.
fn depth(node: usize, inverse: bool) -> f64 {
    let w = f64::from(depth_table::node(node));
    if inverse { SCALE / w } else { w }
}

fn in_range(node: usize, inverse: bool) -> bool {
    (RANGE_MM[0]..=RANGE_MM[1]).contains(&depth(node, inverse))
}

/// w_m − w of a pixel at a node.
fn difference(measured: &impl Fn(usize, f64) -> f64, pixel: usize, node: usize, inverse: bool) -> f64 {
    let z = depth(node, inverse);
    let rho_m = measured(pixel, 1.0 / z);
    if inverse { SCALE * rho_m - SCALE / z } else { 1.0 / rho_m - z }
}

/// The deviation in depth, mm, that a deviation of 1 in w amounts to at a node.
fn weight(node: usize, inverse: bool) -> f64 {
    let z = depth(node, inverse);
    if inverse { z * z / SCALE } else { 1.0 }
}

/// Coefficients of a pixel from its differences w_m − w at the pivots, by forward substitution: at the pivot of φ_k,
/// later functions are 0 and earlier ones are not.
fn coefficients(functions: &[Function], difference: impl Fn(usize) -> f64) -> [f64; MOST_TERMS] {
    let mut c = [0.0; MOST_TERMS];
    for (k, function) in functions.iter().enumerate() {
        let so_far: f64 = (0..k).map(|j| c[j] * functions[j].values[function.pivot]).sum();
        c[k] = difference(function.pivot) - so_far;
    }
    c
}

/// The functions φ for one choice of w, by empirical interpolation; `None` where [`MOST_TERMS`] are not enough.
fn functions(
    measured: &(impl Fn(usize, f64) -> f64 + Sync),
    samples: &[usize],
    inverse: bool,
) -> Option<Vec<Function>> {
    let nodes: Vec<usize> = (0..NODES).step_by(STRIDE).filter(|node| in_range(*node, inverse)).collect();
    // The error of the sum so far, per sampled pixel and node.
    let mut left: Vec<Vec<f64>> = samples
        .par_iter()
        .map(|pixel| nodes.iter().map(|node| difference(measured, *pixel, *node, inverse)).collect())
        .collect();
    if left.iter().flatten().any(|d| !d.is_finite()) {
        return None;
    }
    let mut functions: Vec<Function> = Vec::new();
    loop {
        let entries = left.iter().enumerate().flat_map(|(s, row)| row.iter().enumerate().map(move |(n, d)| (s, n, *d)));
        let size = |n: usize, d: f64| d.abs() * weight(nodes[n], inverse);
        let (s, n, greatest) = entries.max_by(|a, b| size(a.1, a.2).total_cmp(&size(b.1, b.2)))?;
        if size(n, greatest) <= TOLERANCE_MM {
            return Some(functions);
        }
        if functions.len() == MOST_TERMS {
            return None;
        }
        let (pixel, pivot) = (samples[s], nodes[n]);
        let c = coefficients(&functions, |node| difference(measured, pixel, node, inverse));
        let value = |node: usize| {
            let so_far: f64 = functions.iter().zip(c).map(|(f, c)| c * f.values[node]).sum();
            (difference(measured, pixel, node, inverse) - so_far) / greatest
        };
        let values: Vec<f64> = (0..NODES).map(value).collect();
        for row in &mut left {
            let share = row[n];
            for (d, node) in row.iter_mut().zip(&nodes) {
                *d -= share * values[*node];
            }
        }
        functions.push(Function { values, pivot });
    }
}
