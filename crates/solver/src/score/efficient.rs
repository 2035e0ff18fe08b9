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
    /// Σ uᵢuᵢᵀ over the clusters' parts of U, each candidate's about what its own estimate explains of them, uᵢ = Uᵢ − Vᵢ V⁻¹ U:
    /// what V is where residuals are independent (White 1982). About their mean they would scatter by the effect itself, whose
    /// part Vᵢ V⁻¹ U differs from cluster to cluster.
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
        let columns: Vec<usize> = self.columns(candidates).split_off(self.shared);
        let h = &self.total.hessian;
        let shared = h.view((0, 0), (self.shared, self.shared)).into_owned();
        let cross = DMatrix::from_fn(self.shared, columns.len(), |i, k| h[(i, columns[k])]);
        let response = -(pseudo_inverse(&shared, NEGLIGIBLE) * &cross);
        let alone = DMatrix::from_fn(columns.len(), columns.len(), |i, k| h[(columns[i], columns[k])]);
        let information = alone + cross.tr_mul(&response);
        let efficient = |gradient: &DVector<f64>| {
            let direct = DVector::from_fn(columns.len(), |i, _| gradient[columns[i]]);
            -(direct + response.tr_mul(&gradient.rows(0, self.shared).into_owned()))
        };
        let score = efficient(&self.total.gradient);
        let steps = self.steps(candidates, &score, &information, &response);
        let mut scatter = DMatrix::zeros(columns.len(), columns.len());
        for cluster in &*self.clusters {
            let mut left = DVector::zeros(columns.len());
            for (first, step) in &steps {
                let count = step.own;
                let moved = efficient(&(&cluster.gradient + &cluster.hessian * &step.all));
                left.rows_mut(*first, count).copy_from(&moved.rows(*first, count));
            }
            scatter.ger(1.0, &left, &left, 1.0);
        }
        EfficientScores { score, information: (&information + information.transpose()) * 0.5, scatter, response }
    }

    /// For every candidate, its place among the candidates' parameters, and its own Gauss–Newton step V⁻¹ U with what the shared
    /// variables follow.
    fn steps(
        &self,
        candidates: &[usize],
        score: &DVector<f64>,
        information: &DMatrix<f64>,
        response: &DMatrix<f64>,
    ) -> Vec<(usize, Step)> {
        let mut first = 0;
        candidates
            .iter()
            .map(|candidate| {
                let columns = &self.candidates[*candidate];
                let (place, count) = (first, columns.count);
                first += count;
                let of_own = information.view((place, place), (count, count)).into_owned();
                let step = pseudo_inverse(&of_own, NEGLIGIBLE) * score.rows(place, count);
                let mut all = DVector::zeros(self.total.gradient.len());
                all.rows_mut(0, self.shared).copy_from(&(response.columns(place, count) * &step));
                all.rows_mut(columns.first, count).copy_from(&step);
                (place, Step { own: count, all })
            })
            .collect()
    }
}

/// A step of one candidate.
struct Step {
    /// Number of its own parameters.
    own: usize,
    /// Changes of all columns of the linearisation.
    all: DVector<f64>,
}
