//! How smooth functions that were found are: the strengths of their penalties that predict left-out clusters best.

use nalgebra::{DMatrix, DVector};

use super::model::Additive;
use super::normal::{LeftOutParts, Normal};
use super::penalty::{Information, Precision, STRENGTH, block_diagonal};
use super::search::Found;

/// Strengths that are compared.
const STRENGTHS: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, STRENGTH, 1e-1, 1.0];
/// Parts of the clusters, of which one is left out at a time: each has clusters from everywhere. A function has to fill the gaps
/// between clusters, not to go beyond them.
const PARTS: usize = 12;
/// Passes of the choice, one function after the other.
const PASSES: usize = 2;

/// The functions of a search with a strength of smoothness each.
#[derive(Debug)]
pub struct Strengths<'a> {
    model: &'a Additive<'a>,
    found: &'a [Found],
    /// Of every group of every function.
    information: Vec<Vec<Information>>,
    total: Normal,
    parts: LeftOutParts,
    strengths: Vec<f64>,
    gain: f64,
}

impl<'a> Strengths<'a> {
    /// The strengths that predict left-out clusters best. The model may have other splines than that of the search, but has to
    /// have its groups; `None` where it has no clusters.
    pub fn best(model: &'a Additive<'a>, found: &'a [Found]) -> Option<Self> {
        let groups: Vec<usize> = found.iter().flat_map(|function| function.groups.clone()).collect();
        let normals = model.normals(&groups);
        let total = Normal::sum(&normals)?;
        let mut start = model.shared();
        let mut information_of = |number: &usize| {
            let range = start..start + model.groups[*number].count();
            start = range.end;
            let diagonal: Vec<f64> = range.map(|i| total.hessian[(i, i)]).collect();
            Information { total: diagonal.iter().sum(), sums: DVector::from_vec(diagonal) }
        };
        let information =
            found.iter().map(|function| function.groups.iter().map(&mut information_of).collect()).collect();
        let strengths = vec![STRENGTH; found.len()];
        let part_of = (0..normals.len()).map(|cluster| cluster % PARTS.min(normals.len())).collect();
        let parts = LeftOutParts::new(normals, model.shared(), part_of);
        let mut best = Self { model, found, information, total, parts, strengths, gain: f64::NEG_INFINITY };
        for place in (0..found.len()).cycle().take(PASSES * found.len()) {
            for strength in STRENGTHS {
                let mut strengths = best.strengths.clone();
                strengths[place] = strength;
                let gain = best.gain_with(&strengths);
                if gain > best.gain {
                    (best.strengths, best.gain) = (strengths, gain);
                }
            }
        }
        Some(best)
    }

    fn penalty(&self, strengths: &[f64]) -> DMatrix<f64> {
        let mut penalties: Vec<DMatrix<f64>> = Vec::new();
        for ((function, information), strength) in self.found.iter().zip(&self.information).zip(strengths) {
            let of_groups = function.groups.iter().zip(information);
            penalties
                .extend(of_groups.map(|(number, of_group)| of_group.penalty(&self.model.groups[*number], *strength)));
        }
        block_diagonal(&penalties)
    }

    /// Fall of the cost of left-out clusters with these strengths.
    fn gain_with(&self, strengths: &[f64]) -> f64 {
        self.parts.gains(&self.penalty(strengths)).iter().sum()
    }

    /// Fall of the cost ½ Σ r² of left-out clusters.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Precision of the coefficients of every group of function number `place`.
    pub fn precisions(&self, place: usize) -> Vec<Precision> {
        let groups = self.found[place].groups.iter().zip(&self.information[place]);
        groups.map(|(number, i)| i.precision(&self.model.groups[*number], self.strengths[place])).collect()
    }

    /// Coefficients of all groups of all functions, one after the other, estimated together with the shared parameters.
    pub fn coefficients(&self) -> DVector<f64> {
        let shared = self.model.shared();
        let mut total = self.total.clone();
        total.add_prior(shared, &self.penalty(&self.strengths));
        let step = total.step();
        step.rows(shared, step.len() - shared).into_owned()
    }
}
