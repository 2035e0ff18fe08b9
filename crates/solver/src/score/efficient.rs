//! Scores and information of all candidates together: what other data sets need to be pooled with this one.

use nalgebra::{DMatrix, DVector};

use super::linearization::Linearization;
use super::pseudo_inverse::{NEGLIGIBLE, pseudo_inverse};

/// Efficient scores and information of several candidates together, everything else projected out.
///
/// Rows and columns are the parameters of the candidates in the order asked for. Of independent data sets scores and information
/// add up, and V⁻¹ U is the estimate that all parameters would have if they were free (one Gauss–Newton step).
#[derive(Clone, Debug)]
pub struct EfficientScores {
    /// U = −G⊥ᵀr: the gradient of the log-likelihood.
    pub score: DVector<f64>,
    /// V = G⊥ᵀG⊥: the information.
    pub information: DMatrix<f64>,
    /// Σ uᵢuᵢᵀ over the clusters' parts of U, about their mean: what V is where residuals are independent (White 1982).
    pub scatter: DMatrix<f64>,
    /// −(JᵀJ)⁺ JᵀG: the change of the shared variables per unit of a candidate's parameter, one row per shared column.
    pub response: DMatrix<f64>,
}

impl Linearization {
    /// Number of shared columns: free components of variables that belong to no single cluster, in the order of the variables.
    pub fn shared_count(&self) -> usize {
        self.shared
    }

    /// Scores and information of candidates together.
    pub fn efficient_scores(&self, candidates: &[usize]) -> EfficientScores {
        let own: Vec<usize> = self.columns(candidates).split_off(self.shared);
        let h = &self.total.hessian;
        let shared = h.view((0, 0), (self.shared, self.shared)).into_owned();
        let cross = DMatrix::from_fn(self.shared, own.len(), |i, k| h[(i, own[k])]);
        let response = -(pseudo_inverse(&shared, NEGLIGIBLE) * &cross);
        let alone = DMatrix::from_fn(own.len(), own.len(), |i, k| h[(own[i], own[k])]);
        let information = alone + cross.tr_mul(&response);
        let efficient = |gradient: &DVector<f64>| {
            let own = DVector::from_fn(own.len(), |i, _| gradient[own[i]]);
            -(own + response.tr_mul(&gradient.rows(0, self.shared).into_owned()))
        };
        let parts: Vec<DVector<f64>> = self.clusters.iter().map(|cluster| efficient(&cluster.gradient)).collect();
        let mut mean = DVector::zeros(own.len());
        parts.iter().for_each(|part| mean += part);
        mean /= parts.len().max(1) as f64;
        let mut scatter = DMatrix::zeros(own.len(), own.len());
        for part in &parts {
            let about_mean = part - &mean;
            scatter.ger(1.0, &about_mean, &about_mean, 1.0);
        }
        EfficientScores {
            score: efficient(&self.total.gradient),
            information: (&information + information.transpose()) * 0.5,
            scatter,
            response,
        }
    }
}
