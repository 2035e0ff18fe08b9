//! The score test of candidates, what they would be, and what could have been seen of them.

use nalgebra::{DMatrix, DVector};

use super::distribution::{chi_squared_tail, f_tail, noncentrality};
use super::linearization::Linearization;
use super::projection::{NEGLIGIBLE, pseudo_inverse, pseudo_inverse_scaled};

/// Result of a score test.
#[derive(Clone, Debug)]
pub struct Score {
    /// S: about χ² with `rank` degrees of freedom where the candidate is absent and the noise is as the model says.
    pub statistic: f64,
    /// Combinations of the candidate's parameters that the data can see beside the model.
    pub rank: usize,
    /// P(χ² > S).
    pub p_value: f64,
    /// p-value from the scatter of the clusters' scores, which holds whatever the correlation inside a cluster: with U
    /// clusters uᵀ(Σ u uᵀ)⁻¹u as an F statistic (Hotelling 1931). NaN with too few clusters.
    pub clustered_p_value: f64,
    /// Expected parameter change: one Gauss–Newton step from the held values, all else adjusting.
    pub change: DVector<f64>,
    /// Covariance of the change under the model's noise.
    pub covariance: DMatrix<f64>,
    /// Covariance of the change from the scatter between clusters (sandwich).
    pub clustered_covariance: DMatrix<f64>,
}

/// Scores and information of a candidate, everything shared (and `beside`) adjusted for.
pub(super) struct Projected {
    /// G⊥ᵀr.
    pub score: DVector<f64>,
    /// G⊥ᵀG⊥.
    pub information: DMatrix<f64>,
    /// Diagonal of GᵀG.
    pub alone: DVector<f64>,
    /// G⊥ᵀr of every cluster.
    pub by_cluster: Vec<DVector<f64>>,
}

impl Linearization {
    /// Projects a candidate's columns off the shared ones and off those of the candidates `beside` it.
    pub(super) fn project(&self, candidate: usize, beside: &[usize]) -> Projected {
        let nuisance = self.columns(beside);
        let c = &self.candidates[candidate];
        let own: Vec<usize> = (c.first..c.first + c.count).collect();
        let h = &self.total.hessian;
        let pick = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, k| h[(rows[i], columns[k])])
        };
        let inverse = pseudo_inverse(&pick(&nuisance, &nuisance), NEGLIGIBLE);
        let projection = pick(&own, &nuisance) * inverse;
        let information = pick(&own, &own) - &projection * pick(&nuisance, &own);
        let by_cluster: Vec<DVector<f64>> = self
            .clusters
            .iter()
            .map(|cluster| {
                let g = &cluster.gradient;
                let shared = DVector::from_fn(nuisance.len(), |i, _| g[nuisance[i]]);
                DVector::from_fn(own.len(), |i, _| g[own[i]]) - &projection * shared
            })
            .collect();
        let g = &self.total.gradient;
        let shared = DVector::from_fn(nuisance.len(), |i, _| g[nuisance[i]]);
        let score = DVector::from_fn(own.len(), |i, _| g[own[i]]) - &projection * shared;
        let alone = DVector::from_fn(own.len(), |i, _| self.total.alone[own[i]]);
        Projected { score, information: (&information + information.transpose()) * 0.5, alone, by_cluster }
    }

    /// The score test of a candidate, with the model as it is.
    pub fn score(&self, candidate: usize) -> Score {
        self.score_beside(candidate, &[])
    }

    /// The score test of a candidate in the model with the candidates `beside` it released.
    pub fn score_beside(&self, candidate: usize, beside: &[usize]) -> Score {
        let p = self.project(candidate, beside);
        let (inverse, rank) = pseudo_inverse_scaled(&p.information, &p.alone, NEGLIGIBLE);
        let statistic = p.score.dot(&(&inverse * &p.score)).max(0.0);
        let mut scatter = DMatrix::zeros(p.score.len(), p.score.len());
        for u in &p.by_cluster {
            scatter.ger(1.0, u, u, 1.0);
        }
        let change = -(&inverse * &p.score);
        let clusters = p.by_cluster.iter().filter(|u| u.amax() > 0.0).count();
        let (scatter_inverse, _) = pseudo_inverse_scaled(&scatter, &scatter.diagonal(), 1e-9);
        let clustered = p.score.dot(&(scatter_inverse * &p.score));
        let clustered_p_value = clustered_p(clustered, rank, clusters);
        let clustered_covariance = &inverse * &scatter * &inverse;
        Score {
            statistic,
            rank,
            p_value: chi_squared_tail(statistic, rank),
            clustered_p_value,
            change,
            covariance: inverse,
            clustered_covariance,
        }
    }

    /// G⊥ᵀG⊥: what the data say about a candidate's parameters beside the model.
    pub fn visible_information(&self, candidate: usize) -> DMatrix<f64> {
        self.project(candidate, &[]).information
    }

    /// The factor by which the effect `parameters` of a candidate has to be scaled to be found with probability `power` by a
    /// test at level `alpha`.
    pub fn detectable_factor(&self, candidate: usize, parameters: &DVector<f64>, alpha: f64, power: f64) -> f64 {
        let p = self.project(candidate, &[]);
        let (_, rank) = pseudo_inverse_scaled(&p.information, &p.alone, NEGLIGIBLE);
        (noncentrality(rank, alpha, power) / parameters.dot(&(&p.information * parameters))).sqrt()
    }

    /// Cosine of the angle between the effect `parameters` of a candidate, as far as the model leaves it, and everything
    /// that candidate `other` can do: 1 where the other can play it perfectly, 0 where not at all.
    pub fn mimicry(&self, candidate: usize, parameters: &DVector<f64>, other: usize) -> f64 {
        let alone = self.project(candidate, &[]).information;
        let beside = self.project(candidate, &[other]).information;
        let whole = parameters.dot(&(&alone * parameters));
        let rest = parameters.dot(&(&beside * parameters));
        if whole > 0.0 { (1.0 - rest / whole).clamp(0.0, 1.0).sqrt() } else { 1.0 }
    }

    /// Noncentrality of the effect `parameters` of a candidate beside the model and the candidates `beside` it: the square
    /// of its size in standard deviations.
    pub fn noncentrality(&self, candidate: usize, parameters: &DVector<f64>, beside: &[usize]) -> f64 {
        let information = self.project(candidate, beside).information;
        parameters.dot(&(information * parameters)).max(0.0)
    }
}

/// p-value of uᵀ(Σ u uᵀ)⁻¹u, the uncentred form of Hotelling's statistic.
fn clustered_p(statistic: f64, rank: usize, clusters: usize) -> f64 {
    if rank == 0 {
        return 1.0;
    }
    if clusters <= rank + 2 {
        return f64::NAN;
    }
    let n = clusters as f64;
    // The uncentred statistic is at most n.
    let f = (clusters - rank) as f64 / rank as f64 * statistic / (n - statistic).max(1e-12 * n);
    f_tail(f, rank, clusters - rank)
}
