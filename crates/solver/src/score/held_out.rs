//! What candidates gain on clusters that did not take part in their estimation.

use nalgebra::{DMatrix, DVector};

use super::linearization::{Cluster, Linearization};
use super::projection::{NEGLIGIBLE, pseudo_inverse};

/// Strengths of a smoothness prior that are tried, relative to the information of the data.
const STRENGTHS: [f64; 6] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];

impl Linearization {
    /// For every cluster, by how much its cost ½ Σ r² (its own variables adjusting) is lower when the shared variables and
    /// these candidates, released together, are estimated from all other clusters than when the shared variables alone
    /// are. Negative where the candidates do harm.
    ///
    /// The problem is taken as linear, so this costs small dense algebra and no new solution. A candidate with a smoothness
    /// prior gets the strength at which the sum is largest.
    pub fn held_out_gain(&self, candidates: &[usize]) -> Vec<f64> {
        let penalised = candidates.iter().any(|c| self.candidates[*c].smoothness.is_some());
        let strengths: &[f64] = if penalised { &STRENGTHS } else { &STRENGTHS[..1] };
        let base = self.left_out_costs(&[], 0.0);
        let total = |gain: &Vec<f64>| gain.iter().sum::<f64>();
        strengths
            .iter()
            .map(|strength| {
                let costs = self.left_out_costs(candidates, *strength);
                base.iter().zip(costs).map(|(b, c)| b - c).collect::<Vec<f64>>()
            })
            .max_by(|a, b| total(a).total_cmp(&total(b)))
            .unwrap_or_default()
    }

    /// Change of every cluster's cost from the present values when it is left out of the estimate.
    fn left_out_costs(&self, candidates: &[usize], strength: f64) -> Vec<f64> {
        let columns = self.columns(candidates);
        let pick = |cluster: &Cluster| {
            let h = DMatrix::from_fn(columns.len(), columns.len(), |i, k| cluster.hessian[(columns[i], columns[k])]);
            let g = DVector::from_fn(columns.len(), |i, _| cluster.gradient[columns[i]]);
            (h, g)
        };
        let (mut whole, gradient) = pick(&self.total);
        self.add_priors(candidates, strength, &mut whole);
        self.clusters
            .iter()
            .map(|cluster| {
                let (h, g) = pick(cluster);
                let step = -(pseudo_inverse(&(&whole - &h), NEGLIGIBLE) * (&gradient - &g));
                g.dot(&step) + 0.5 * step.dot(&(h * &step))
            })
            .collect()
    }

    /// Adds the candidates' smoothness priors, scaled to the information that the data have, to their block.
    pub(super) fn add_priors(&self, candidates: &[usize], strength: f64, hessian: &mut DMatrix<f64>) {
        let mut at = self.shared;
        for c in candidates {
            let columns = &self.candidates[*c];
            if let Some(prior) = &columns.smoothness {
                let data: f64 =
                    (0..columns.count).map(|i| self.total.hessian[(columns.first + i, columns.first + i)]).sum();
                let scale = strength * data / prior.trace().max(f64::MIN_POSITIVE);
                let mut block = hessian.view_mut((at, at), (columns.count, columns.count));
                block += prior * scale;
            }
            at += columns.count;
        }
    }

    /// Expected change of several candidates released together; with priors at the strength that gains most on left-out
    /// clusters. Concatenated in the given order.
    pub fn joint_change(&self, candidates: &[usize]) -> DVector<f64> {
        let columns = self.columns(candidates);
        let mut h = DMatrix::from_fn(columns.len(), columns.len(), |i, k| self.total.hessian[(columns[i], columns[k])]);
        let g = DVector::from_fn(columns.len(), |i, _| self.total.gradient[columns[i]]);
        self.add_priors(candidates, self.best_strength(candidates), &mut h);
        let step = -(pseudo_inverse(&h, NEGLIGIBLE) * g);
        step.rows(self.shared, step.len() - self.shared).into_owned()
    }

    /// The strength of the candidates' smoothness priors that gains most on left-out clusters.
    fn best_strength(&self, candidates: &[usize]) -> f64 {
        let cost = |s: &f64| self.left_out_costs(candidates, *s).iter().sum::<f64>();
        STRENGTHS.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(1.0)
    }
}
