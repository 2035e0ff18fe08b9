//! Normal equations of a problem at its minimum, cluster by cluster, from which score tests are computed.

use std::sync::Arc;

use rayon::prelude::*;

use super::structure::{Candidate, Cluster, Columns, ScoreError, Structure};
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;
use crate::problem::values::Values;

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
