//! Normal equations over shared columns followed by others: estimates, and the cost that columns explain in clusters that were
//! left out.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A quadratic cost gᵀw + ½ wᵀHw over the shared columns followed by others.
#[derive(Debug, Clone)]
pub struct Normal {
    /// H
    pub hessian: DMatrix<f64>,
    /// g
    pub gradient: DVector<f64>,
}

/// Ridge on columns scaled to equal curvature: far below what noise determines, far above rounding.
const RIDGE: f64 = 1e-9;

impl Normal {
    /// Adds another one.
    pub fn add(&mut self, other: &Self) {
        self.hessian += &other.hessian;
        self.gradient += &other.gradient;
    }

    /// A sum without one of its terms.
    #[must_use]
    pub fn without(&self, term: &Self) -> Self {
        Self { hessian: &self.hessian - &term.hessian, gradient: &self.gradient - &term.gradient }
    }

    /// The sum of some; `None` of none.
    pub fn sum<'a>(normals: impl IntoIterator<Item = &'a Self>) -> Option<Self> {
        let mut normals = normals.into_iter();
        let first = normals.next()?.clone();
        Some(normals.fold(first, |mut sum, normal| {
            sum.add(normal);
            sum
        }))
    }

    /// The first `shared` columns alone.
    #[must_use]
    pub fn of_shared(&self, shared: usize) -> Self {
        Self {
            hessian: self.hessian.view((0, 0), (shared, shared)).into_owned(),
            gradient: self.gradient.rows(0, shared).into_owned(),
        }
    }

    /// Adds the normal matrix of a prior on the columns after the first `shared`.
    pub fn add_prior(&mut self, shared: usize, prior: &DMatrix<f64>) {
        let more = self.gradient.len() - shared;
        let mut block = self.hessian.view_mut((shared, shared), (more, more));
        block += prior;
    }

    /// The step that minimises the cost; undetermined combinations stay as they are.
    pub fn step(&self) -> DVector<f64> {
        let n = self.gradient.len();
        // Columns have units of their own: scaled to equal curvature, so that a common bound tells what is undetermined.
        let scale: Vec<f64> =
            self.hessian.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt().recip() } else { 0.0 }).collect();
        let scaled = DMatrix::from_fn(n, n, |i, k| {
            let ridge = if i == k { RIDGE } else { 0.0 };
            self.hessian[(i, k)] * scale[i] * scale[k] + ridge
        });
        let gradient = DVector::from_fn(n, |i, _| -self.gradient[i] * scale[i]);
        match scaled.cholesky() {
            Some(factor) => DVector::from_fn(n, |i, _| scale[i]).component_mul(&factor.solve(&gradient)),
            None => DVector::zeros(n),
        }
    }

    /// The change of the cost by a step.
    pub fn change(&self, step: &DVector<f64>) -> f64 {
        self.gradient.dot(step) + 0.5 * step.dot(&(&self.hessian * step))
    }
}

/// Clusters in parts, with what is the same for all priors on the columns after the first `shared`: the normal equations of the
/// clusters of all other parts, and the shared columns alone estimated from them.
#[derive(Debug)]
pub(super) struct LeftOutParts {
    normals: Vec<Normal>,
    shared: usize,
    part_of: Vec<usize>,
    /// Of every part; `None` where it has all clusters.
    others: Vec<Option<(Normal, DVector<f64>)>>,
}

impl LeftOutParts {
    /// `part_of` has the part of every cluster.
    pub fn new(normals: Vec<Normal>, shared: usize, part_of: Vec<usize>) -> Self {
        let parts = part_of.iter().max().map_or(0, |last| last + 1);
        let of_part = |part: usize| {
            let others = normals.iter().zip(&part_of).filter(|(_, other)| **other != part).map(|(normal, _)| normal);
            let others = Normal::sum(others)?;
            let without = others.of_shared(shared).step();
            Some((others, without))
        };
        let others = (0..parts).into_par_iter().map(of_part).collect();
        Self { normals, shared, part_of, others }
    }

    /// Fall of the cost of every cluster when the columns after the shared ones are estimated from the clusters of all other
    /// parts, with `prior` added to their normal matrix, over that with the shared columns alone.
    pub fn gains(&self, prior: &DMatrix<f64>) -> Vec<f64> {
        let with = |others: &Option<(Normal, DVector<f64>)>| {
            let mut with = others.as_ref()?.0.clone();
            with.add_prior(self.shared, prior);
            Some(with.step())
        };
        let steps: Vec<Option<DVector<f64>>> = self.others.par_iter().map(with).collect();
        let gain = |(normal, part): (&Normal, &usize)| {
            let (Some((_, without)), Some(with)) = (&self.others[*part], &steps[*part]) else { return 0.0 };
            normal.of_shared(self.shared).change(without) - normal.change(with)
        };
        self.normals.par_iter().zip(&self.part_of).map(gain).collect()
    }
}
