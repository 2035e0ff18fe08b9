//! Normal equations of a problem at its minimum, cluster by cluster, from which score tests are computed.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use thiserror::Error;

use super::pseudo_inverse::{NEGLIGIBLE, pseudo_inverse};
use super::structure::Structure;
use crate::problem::error::EvaluationFailure;
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;
use crate::problem::values::Values;

/// A possible effect: fixed variables of the graph that are tested together.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name for reports.
    pub name: String,
    /// The variables; their fixed components are the candidate's parameters.
    pub variables: Vec<VariableId>,
    /// Precision matrix, up to a factor, of a normal prior on the change of the parameters, for candidates with so many
    /// parameters that they need one (maps, splines). The factor with the largest gain on held-out clusters is used.
    pub smoothness: Option<DMatrix<f64>>,
}

impl Candidate {
    /// A candidate of one variable without a prior.
    pub fn new(name: impl Into<String>, variable: impl Into<VariableId>) -> Self {
        Self { name: name.into(), variables: vec![variable.into()], smoothness: None }
    }
}

/// A problem cannot be linearised for score tests.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ScoreError {
    /// A batch cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] EvaluationFailure),
    /// A variable of a candidate has no fixed component: it is part of the model already.
    #[error("candidate \"{candidate}\": no component of {variable} is fixed; only fixed components can be tested")]
    NotFixed {
        /// The candidate.
        candidate: String,
        /// The variable's label.
        variable: String,
    },
    /// A smoothness prior has another size than its candidate.
    #[error(
        "the smoothness of candidate \"{candidate}\" is a {found}×{found} matrix, but it has {expected} parameters"
    )]
    Smoothness {
        /// The candidate.
        candidate: String,
        /// Size of the matrix.
        found: usize,
        /// Number of parameters.
        expected: usize,
    },
}

/// Normal equations of one cluster over shared and candidate columns, its own variables eliminated.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub hessian: DMatrix<f64>,
    pub gradient: DVector<f64>,
    /// Diagonal of the Hessian before elimination: the curvatures of the columns alone, relative to which ranks are judged.
    pub alone: DVector<f64>,
    /// ½ Σ r² of the weighted residuals.
    pub cost: f64,
    /// Scalar residuals.
    pub rows: usize,
}

/// Normal equations of a problem at given values, cluster by cluster, over the *shared* variables, those free ones that
/// belong to no single cluster, and over the candidates' parameters. Rows are weighted by √ρ′ as in the solver.
#[derive(Clone, Debug)]
pub struct Linearization {
    /// Shared by copies: some tens of thousands of numbers each.
    pub(super) clusters: Arc<[Cluster]>,
    pub(super) shared: usize,
    pub(super) candidates: Vec<Columns>,
    pub(super) total: Cluster,
}

/// The columns of a candidate.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub name: String,
    pub first: usize,
    pub count: usize,
    pub smoothness: Option<DMatrix<f64>>,
}

impl Linearization {
    /// Linearises `graph` at `values`, which should be the minimum over its free variables. The groups of residuals that
    /// depend on the variable `clusters[i]` form cluster i. Groups that depend on none of these variables are shared by
    /// all clusters and never held out.
    ///
    /// # Errors
    /// If a factor cannot be evaluated, or a candidate is not fixed or has a prior of the wrong size.
    pub fn new(
        graph: &Graph,
        values: &Values,
        clusters: &[VariableId],
        candidates: &[Candidate],
    ) -> Result<Self, ScoreError> {
        let structure = Structure::of(graph, values, clusters, candidates)?;
        let total = structure.reduced();
        let reduced: Result<Vec<Cluster>, ScoreError> =
            (0..=clusters.len()).into_par_iter().map(|cluster| structure.accumulate(graph, values, cluster)).collect();
        let Structure { shared, candidates: columns, .. } = structure;
        let mut clusters = reduced?;
        let common = clusters.pop().unwrap_or_else(|| Cluster::empty(total));
        let mut sum = common;
        for cluster in &clusters {
            sum.hessian += &cluster.hessian;
            sum.gradient += &cluster.gradient;
            sum.alone += &cluster.alone;
            sum.cost += cluster.cost;
            sum.rows += cluster.rows;
        }
        Ok(Self { clusters: clusters.into(), shared, candidates: columns, total: sum })
    }

    /// Number of clusters.
    pub fn cluster_count(&self) -> usize {
        self.clusters.len()
    }

    /// Number of scalar residuals of a cluster.
    pub fn cluster_rows(&self, cluster: usize) -> usize {
        self.clusters[cluster].rows
    }

    /// ½ Σ r² of a cluster's weighted residuals at the present values.
    pub fn cluster_cost(&self, cluster: usize) -> f64 {
        self.clusters[cluster].cost
    }

    /// Number of candidates.
    pub fn candidate_count(&self) -> usize {
        self.candidates.len()
    }

    /// A candidate's name.
    pub fn name(&self, candidate: usize) -> &str {
        &self.candidates[candidate].name
    }

    /// Number of a candidate's parameters.
    pub fn parameter_count(&self, candidate: usize) -> usize {
        self.candidates[candidate].count
    }

    /// A copy with the information of a cluster of another linearisation over the same variables and candidates: the
    /// information that these data and the additional cluster would have together. Gradients and costs are not changed,
    /// as if the additional residuals were zero.
    ///
    /// # Panics
    /// If the other linearisation has another number of columns.
    #[must_use]
    pub fn with_cluster(&self, other: &Self, cluster: usize) -> Self {
        assert_eq!(self.total.hessian.shape(), other.total.hessian.shape(), "linearisations of different problems");
        let mut extended = self.clone();
        extended.total.hessian += &other.clusters[cluster].hessian;
        extended.total.alone += &other.clusters[cluster].alone;
        extended
    }

    /// The columns of the shared variables followed by those of the candidates.
    pub(super) fn columns(&self, candidates: &[usize]) -> Vec<usize> {
        let range = |c: &usize| self.candidates[*c].first..self.candidates[*c].first + self.candidates[*c].count;
        (0..self.shared).chain(candidates.iter().flat_map(range)).collect()
    }
}

impl Cluster {
    fn empty(columns: usize) -> Self {
        let zeros = DVector::zeros(columns);
        Self { hessian: DMatrix::zeros(columns, columns), gradient: zeros.clone(), alone: zeros, cost: 0.0, rows: 0 }
    }
}

/// Eliminates the first `local` columns by a Schur complement. Undetermined combinations of them are kept at their
/// values, by the pseudo-inverse.
pub(super) fn eliminate(hessian: &DMatrix<f64>, gradient: &DVector<f64>, local: usize) -> Cluster {
    let reduced = hessian.nrows() - local;
    let alone = hessian.diagonal().rows(local, reduced).into_owned();
    let cross = hessian.view((0, local), (local, reduced)).into_owned();
    let eliminated = hessian.view((0, 0), (local, local)).into_owned();
    let inverse = pseudo_inverse(&eliminated, NEGLIGIBLE);
    let carried = &inverse * &cross;
    let hessian = hessian.view((local, local), (reduced, reduced)) - cross.tr_mul(&carried);
    let gradient = gradient.rows(local, reduced) - carried.tr_mul(&gradient.rows(0, local).into_owned());
    Cluster { hessian: (&hessian + hessian.transpose()) * 0.5, gradient, alone, cost: 0.0, rows: 0 }
}
