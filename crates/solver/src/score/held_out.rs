//! Gain of candidates on held-out clusters.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::linearization::Linearization;
use super::pseudo_inverse::{NEGLIGIBLE, pseudo_solve};
use super::structure::Cluster;

/// Strengths of smoothness priors that are tried: trace of the prior's precision relative to that of the data's information.
const STRENGTHS: [f64; 6] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];

impl Linearization {
    /// For every cluster, the decrease of its cost ½ Σ r² due to these candidates when they are estimated from all other
    /// clusters: the cost with the shared variables alone estimated there, minus the cost with the shared variables and the
    /// candidates estimated jointly. The variables of the held-out cluster itself adjust in both cases. Negative if the
    /// candidates make the prediction worse.
    ///
    /// The problem is treated as linear, which takes some small dense algebra and no new solution. If candidates have
    /// smoothness priors, these get the strength with the largest total gain.
    pub fn held_out_gain(&self, candidates: &[usize]) -> Vec<f64> {
        let penalised = candidates.iter().any(|c| self.candidates[*c].smoothness.is_some());
        let strengths: &[f64] = if penalised { &STRENGTHS } else { &STRENGTHS[..1] };
        let base = self.held_out_costs(&[], 0.0);
        let total = |gain: &Vec<f64>| gain.iter().sum::<f64>();
        strengths
            .iter()
            .map(|strength| {
                let costs = self.held_out_costs(candidates, *strength);
                base.iter().zip(costs).map(|(b, c)| b - c).collect::<Vec<f64>>()
            })
            .max_by(|a, b| total(a).total_cmp(&total(b)))
            .unwrap_or_default()
    }

    /// For every cluster, the change of its cost, relative to the present values, when the shared variables and the
    /// candidates are estimated from all other clusters.
    fn held_out_costs(&self, candidates: &[usize], strength: f64) -> Vec<f64> {
        let columns = self.columns(candidates);
        let pick = |cluster: &Cluster| {
            let h = DMatrix::from_fn(columns.len(), columns.len(), |i, k| cluster.hessian[(columns[i], columns[k])]);
            let g = DVector::from_fn(columns.len(), |i, _| cluster.gradient[columns[i]]);
            (h, g)
        };
        let (mut whole, gradient) = pick(&self.total);
        self.add_priors(candidates, strength, &mut whole);
        self.clusters
            .par_iter()
            .map(|cluster| {
                let (h, g) = pick(cluster);
                let step = -pseudo_solve(&(&whole - &h), &(&gradient - &g), NEGLIGIBLE);
                g.dot(&step) + 0.5 * step.dot(&(h * &step))
            })
            .collect()
    }

    /// Adds the candidates' smoothness priors to their diagonal blocks of `hessian`, scaled by `strength` relative to the
    /// data's information. Rows and columns of `hessian` are those of [`columns`](Self::columns).
    pub(super) fn add_priors(&self, candidates: &[usize], strength: f64, hessian: &mut DMatrix<f64>) {
        let mut first = self.shared;
        for c in candidates {
            let columns = &self.candidates[*c];
            if let Some(prior) = &columns.smoothness {
                let data: f64 =
                    (0..columns.count).map(|i| self.total.hessian[(columns.first + i, columns.first + i)]).sum();
                let scale = strength * data / prior.trace().max(f64::MIN_POSITIVE);
                let mut block = hessian.view_mut((first, first), (columns.count, columns.count));
                block += prior * scale;
            }
            first += columns.count;
        }
    }

    /// Expected change of several candidates estimated jointly, concatenated in the given order. Smoothness priors have the
    /// strength with the largest gain on held-out clusters.
    pub fn joint_change(&self, candidates: &[usize]) -> DVector<f64> {
        let columns = self.columns(candidates);
        let mut h = DMatrix::from_fn(columns.len(), columns.len(), |i, k| self.total.hessian[(columns[i], columns[k])]);
        let g = DVector::from_fn(columns.len(), |i, _| self.total.gradient[columns[i]]);
        self.add_priors(candidates, self.best_strength(candidates), &mut h);
        let step = -pseudo_solve(&h, &g, NEGLIGIBLE);
        step.rows(self.shared, step.len() - self.shared).into_owned()
    }

    /// The strength of the candidates' smoothness priors with the largest gain on held-out clusters.
    fn best_strength(&self, candidates: &[usize]) -> f64 {
        let cost = |s: &f64| self.held_out_costs(candidates, *s).iter().sum::<f64>();
        STRENGTHS.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(1.0)
    }
}
