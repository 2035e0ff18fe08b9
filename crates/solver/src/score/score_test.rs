//! The score test of candidates, their expected change, and the size of effects that the data can reveal.

use depthcal_statistics::{chi_squared_tail, f_tail, noncentrality};
use nalgebra::{DMatrix, DVector};

use super::linearization::Linearization;
use super::pseudo_inverse::{NEGLIGIBLE, pseudo_inverse, pseudo_inverse_scaled};

/// Result of a score test.
#[derive(Clone, Debug)]
pub struct Score {
    /// S, distributed approximately as χ² with `rank` degrees of freedom if the candidate has no effect and the noise
    /// model is right.
    pub statistic: f64,
    /// Number of combinations of the candidate's parameters that the data determine jointly with the model.
    pub rank: usize,
    /// P(χ² > S) with `rank` degrees of freedom.
    pub p_value: f64,
    /// p-value from the scatter of the clusters' scores uᵢ, valid for any correlation within clusters: with u = Σ uᵢ,
    /// uᵀ(Σ uᵢ uᵢᵀ)⁻¹u as an F statistic (Hotelling 1931). NaN with too few clusters.
    pub clustered_p_value: f64,
    /// Expected change of the parameters: one Gauss–Newton step from the fixed values, jointly with all free variables.
    pub change: DVector<f64>,
    /// Covariance of the change according to the noise model.
    pub covariance: DMatrix<f64>,
    /// Covariance of the change from the scatter between clusters (sandwich estimator).
    pub clustered_covariance: DMatrix<f64>,
}

/// Score and information of a candidate, adjusted for the shared variables and for other candidates.
pub(super) struct Projected {
    /// G⊥ᵀr.
    pub score: DVector<f64>,
    /// G⊥ᵀG⊥.
    pub information: DMatrix<f64>,
    /// Diagonal of GᵀG, before adjustment.
    pub alone: DVector<f64>,
    /// G⊥ᵀr of every cluster.
    pub by_cluster: Vec<DVector<f64>>,
}

impl Linearization {
    /// Projects a candidate's columns onto the orthogonal complement of the shared columns and of those of the candidates in
    /// `others`.
    pub(super) fn project(&self, candidate: usize, others: &[usize]) -> Projected {
        let nuisance = self.columns(others);
        let c = &self.candidates[candidate];
        let tested: Vec<usize> = (c.first..c.first + c.count).collect();
        let h = &self.total.hessian;
        let pick = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, k| h[(rows[i], columns[k])])
        };
        let inverse = pseudo_inverse(&pick(&nuisance, &nuisance), NEGLIGIBLE);
        let projection = pick(&tested, &nuisance) * inverse;
        let information = pick(&tested, &tested) - &projection * pick(&nuisance, &tested);
        let by_cluster: Vec<DVector<f64>> = self
            .clusters
            .iter()
            .map(|cluster| {
                let g = &cluster.gradient;
                let shared = DVector::from_fn(nuisance.len(), |i, _| g[nuisance[i]]);
                DVector::from_fn(tested.len(), |i, _| g[tested[i]]) - &projection * shared
            })
            .collect();
        let g = &self.total.gradient;
        let shared = DVector::from_fn(nuisance.len(), |i, _| g[nuisance[i]]);
        let score = DVector::from_fn(tested.len(), |i, _| g[tested[i]]) - &projection * shared;
        let alone = DVector::from_fn(tested.len(), |i, _| self.total.alone[tested[i]]);
        Projected { score, information: (&information + information.transpose()) * 0.5, alone, by_cluster }
    }

    /// The score test of a candidate.
    pub fn score(&self, candidate: usize) -> Score {
        self.score_adjusted(candidate, &[])
    }

    /// The score test of a candidate, adjusted for the candidates in `others`: as if these were free in the model.
    pub fn score_adjusted(&self, candidate: usize, others: &[usize]) -> Score {
        let p = self.project(candidate, others);
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

    /// G⊥ᵀG⊥, the information of the data on a candidate's parameters when they are estimated jointly with the model: one
    /// row and column per parameter.
    pub fn visible_information(&self, candidate: usize) -> DMatrix<f64> {
        self.project(candidate, &[]).information
    }

    /// The factors by which effects, each the values of all parameters of a candidate, must be scaled for the test at level
    /// `alpha` to detect them with probability `power`.
    pub fn detectable_factors(&self, candidate: usize, effects: &[DVector<f64>], alpha: f64, power: f64) -> Vec<f64> {
        let p = self.project(candidate, &[]);
        let (_, rank) = pseudo_inverse_scaled(&p.information, &p.alone, NEGLIGIBLE);
        let sufficient = noncentrality(rank, alpha, power);
        effects.iter().map(|effect| (sufficient / effect.dot(&(&p.information * effect))).sqrt()).collect()
    }

    /// How well candidate `other` can reproduce an effect, the values `parameters` of a candidate: the cosine of the
    /// angle between the effect on the residuals and the space of all effects of `other`, both adjusted for the model. 1
    /// if it can be reproduced exactly, 0 if not at all.
    pub fn mimicry(&self, candidate: usize, parameters: &DVector<f64>, other: usize) -> f64 {
        let alone = self.project(candidate, &[]).information;
        let adjusted = self.project(candidate, &[other]).information;
        let whole = parameters.dot(&(&alone * parameters));
        let remaining = parameters.dot(&(&adjusted * parameters));
        if whole > 0.0 { (1.0 - remaining / whole).clamp(0.0, 1.0).sqrt() } else { 1.0 }
    }

    /// Noncentrality of an effect, the values `parameters` of a candidate, adjusted for the model and the candidates in
    /// `others`: the square of its size in standard deviations.
    pub fn noncentrality(&self, candidate: usize, parameters: &DVector<f64>, others: &[usize]) -> f64 {
        let information = self.project(candidate, others).information;
        parameters.dot(&(information * parameters)).max(0.0)
    }
}

/// p-value of uᵀ(Σ uᵢ uᵢᵀ)⁻¹u, the uncentred form of Hotelling's statistic.
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
