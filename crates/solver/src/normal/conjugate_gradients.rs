//! Preconditioned conjugate gradients on the Schur complement, without forming it (Agarwal et al. 2010).

use pulp::{Arch, Simd, WithSimd};

use crate::normal::chunk::Chunk;
use crate::normal::eliminate::multiply_strip;
use crate::normal::kernels;
use crate::normal::reduced_blocks::ReducedBlocks;
use crate::plan::linear_solver::Preconditioner;

/// Relative reduction of the residual, in the norm of the preconditioner, at which the iteration stops.
const TOLERANCE: f64 = 1e-10;

/// A diagonal block of the preconditioner.
#[derive(Clone, Copy, Debug)]
struct Diagonal {
    offset: usize,
    d: usize,
    /// First entry in `factors`.
    start: usize,
}

/// Solver of (H_cc + μ D² − H_ce (H_ee + μ D²)⁻¹ H_ec) x = b that uses the matrix only in products with vectors.
#[derive(Clone, Debug)]
pub(crate) struct ConjugateGradients {
    preconditioner: Preconditioner,
    diagonal: Vec<Diagonal>,
    /// Cholesky factors of the preconditioner's blocks.
    factors: Vec<f64>,
    /// For every component the first entry in `factors` of its block.
    start_of: Vec<usize>,
    /// μ D².
    damping: Vec<f64>,
    /// Scratch: L⁻¹ H_ec of one eliminated and one kept variable.
    w: Vec<f64>,
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
    /// Number of iterations of the last solution.
    pub iterations: usize,
}

impl ConjugateGradients {
    pub fn new(n: usize, blocks: &ReducedBlocks, chunks: &[Chunk], preconditioner: Preconditioner) -> Self {
        let (mut diagonal, mut start_of, mut start, mut largest) = (Vec::new(), vec![0; n], 0, 0);
        for (offset, d) in blocks.diagonal_blocks() {
            diagonal.push(Diagonal { offset, d, start });
            start_of[offset..offset + d].fill(start);
            start += d * d;
            largest = largest.max(d);
        }
        let eliminated = chunks.iter().flat_map(|c| &c.plan.eliminations).map(|e| e.d as usize).max().unwrap_or(0);
        let zeros = || vec![0.0; n];
        Self {
            preconditioner,
            diagonal,
            factors: vec![0.0; start],
            start_of,
            damping: zeros(),
            w: vec![0.0; eliminated * largest],
            residual: zeros(),
            preconditioned: zeros(),
            direction: zeros(),
            product: zeros(),
            iterations: 0,
        }
    }

    /// Sets μ D² and factorises the preconditioner; false if it is not positive definite.
    #[must_use]
    pub fn prepare(&mut self, chunks: &[Chunk], blocks: &ReducedBlocks, mu: f64, d2: &[f64]) -> bool {
        self.damping.iter_mut().zip(d2).for_each(|(t, d2)| *t = mu * d2);
        self.factors.fill(0.0);
        blocks.copy_diagonal(&mut self.factors);
        for b in &self.diagonal {
            (0..b.d).for_each(|i| self.factors[b.start + i * b.d + i] += self.damping[b.offset + i]);
        }
        if self.preconditioner == Preconditioner::SchurJacobi {
            chunks.iter().for_each(|chunk| self.subtract(chunk));
        }
        self.diagonal.iter().all(|b| kernels::cholesky(&mut self.factors[b.start..][..b.d * b.d], b.d))
    }

    /// Subtracts the diagonal blocks of a chunk's H_ce (H_ee + μ D²)⁻¹ H_ec.
    fn subtract(&mut self, chunk: &Chunk) {
        for e in &chunk.plan.eliminations {
            let (d, strip) = (e.d as usize, &chunk.plan.strips[e.strip as usize]);
            let (l, stride) = (&chunk.lee[e.ee..][..d * d], strip.stride as usize);
            for v in &strip.variables {
                let (column, n) = (v.column as usize, v.d as usize);
                let w = &mut self.w[..d * n];
                for (i, row) in w.chunks_exact_mut(n).enumerate() {
                    row.copy_from_slice(&chunk.hec[e.ec + i * stride + column..][..n]);
                }
                kernels::solve_lower(l, d, w, n);
                let target = &mut self.factors[self.start_of[v.kept as usize]..][..n * n];
                for row in w.chunks_exact(n) {
                    for i in 0..n {
                        (0..n).for_each(|j| target[i * n + j] -= row[i] * row[j]);
                    }
                }
            }
        }
    }

    /// z ← M⁻¹ r, with M the preconditioner; returns rᵀ z.
    fn precondition(&mut self) -> f64 {
        self.preconditioned.copy_from_slice(&self.residual);
        for b in &self.diagonal {
            let (l, x) = (&self.factors[b.start..][..b.d * b.d], &mut self.preconditioned[b.offset..][..b.d]);
            kernels::solve_lower(l, b.d, x, 1);
            kernels::solve_lower_transposed(l, b.d, x);
        }
        dot(&self.residual, &self.preconditioned)
    }

    /// Solves in place; false if the matrix is not positive definite. `multiply` calls [`multiply_chunk`] for every
    /// chunk, on as many threads as the caller likes.
    #[must_use]
    pub fn solve(
        &mut self,
        rhs: &mut [f64],
        chunks: &mut [Chunk],
        blocks: &ReducedBlocks,
        multiply: impl Fn(&mut [Chunk], &[f64]),
    ) -> bool {
        self.iterations = 0;
        self.residual.copy_from_slice(rhs);
        rhs.fill(0.0);
        let mut rz = self.precondition();
        let goal = TOLERANCE * TOLERANCE * rz;
        self.direction.copy_from_slice(&self.preconditioned);
        for _ in 0..2 * rhs.len() + 10 {
            if rz <= goal || rz == 0.0 {
                break;
            }
            self.product.iter_mut().zip(&self.damping).zip(&self.direction).for_each(|((q, d), p)| *q = d * p);
            blocks.multiply(&self.direction, &mut self.product);
            multiply(chunks, &self.direction);
            for chunk in chunks.iter() {
                for local in &chunk.plan.locals {
                    let target = &mut self.product[local.kept as usize..][..local.d as usize];
                    target.iter_mut().zip(&chunk.product[local.local as usize..]).for_each(|(t, s)| *t -= s);
                }
            }
            let curvature = dot(&self.direction, &self.product);
            if !(curvature > 0.0 && rz.is_finite()) {
                return false;
            }
            self.iterations += 1;
            let alpha = rz / curvature;
            rhs.iter_mut().zip(&self.direction).for_each(|(x, p)| *x += alpha * p);
            self.residual.iter_mut().zip(&self.product).for_each(|(r, q)| *r -= alpha * q);
            let last = rz;
            rz = self.precondition();
            let beta = rz / last;
            self.direction.iter_mut().zip(&self.preconditioned).for_each(|(p, z)| *p = z + beta * *p);
        }
        rhs.iter().all(|x| x.is_finite())
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Writes the chunk's part of H_ce (H_ee + μ D²)⁻¹ H_ec x into its `product`; `x` is over all kept variables.
pub(crate) fn multiply_chunk(chunk: &mut Chunk, x: &[f64]) {
    Arch::new().dispatch(MultiplyChunk { chunk, x });
}

struct MultiplyChunk<'a> {
    chunk: &'a mut Chunk,
    x: &'a [f64],
}

impl WithSimd for MultiplyChunk<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Chunk { plan, hec, lee, step, product, .. } = self.chunk;
        product.fill(0.0);
        for e in &plan.eliminations {
            let (d, strip) = (e.d as usize, &plan.strips[e.strip as usize]);
            let (t, stride) = (&mut step[e.e..][..d], strip.stride as usize);
            t.fill(0.0);
            multiply_strip(simd, strip, &hec[e.ec..], d, self.x, t);
            let l = &lee[e.ee..][..d * d];
            kernels::solve_lower(l, d, t, 1);
            kernels::solve_lower_transposed(l, d, t);
            for v in &strip.variables {
                let target = &mut product[v.local as usize..][..v.d as usize];
                for (i, t) in t.iter().enumerate() {
                    let row = &hec[e.ec + i * stride + v.column as usize..];
                    target.iter_mut().zip(row).for_each(|(y, h)| *y += h * t);
                }
            }
        }
    }
}
