//! Normal equations of a problem at its minimum, cluster by cluster, from which score tests are computed.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use thiserror::Error;

use super::pseudo_inverse::{NEGLIGIBLE, pseudo_inverse};
use crate::normal::kernels;
use crate::problem::error::EvaluationFailure;
use crate::problem::graph::{BatchId, Fixed, Graph};
use crate::problem::key::VariableId;
use crate::problem::loss::Loss;
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

/// The place of a variable's component in a cluster's normal equations.
#[derive(Clone, Copy)]
enum Role {
    /// None: the component is fixed and belongs to no candidate.
    None,
    /// It belongs to this cluster alone: its index among the cluster's local components, which are eliminated.
    Local(usize),
    /// A column of the reduced system.
    Reduced(usize),
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
        let cluster_of: HashMap<VariableId, usize> = clusters.iter().enumerate().map(|(i, id)| (*id, i)).collect();
        // Groups by cluster; the last entry has the groups that belong to none.
        let mut members: Vec<Vec<(BatchId, usize)>> = vec![Vec::new(); clusters.len() + 1];
        let mut homes: HashMap<VariableId, Home> = HashMap::new();
        for (id, batch) in graph.batches() {
            for group in 0..batch.group_count() {
                let variables = batch.variables(group);
                let cluster = variables.iter().find_map(|v| cluster_of.get(v)).copied().unwrap_or(clusters.len());
                members[cluster].push((id, group));
                for v in variables {
                    let home = homes.entry(*v).or_insert(Home::One(cluster));
                    if *home != Home::One(cluster) || cluster == clusters.len() {
                        *home = Home::Many;
                    }
                }
            }
        }
        let (mut columns, owner) = collect_candidates(graph, values, candidates)?;
        let (roles, shared) = assign_roles(graph, values, &homes, &owner, clusters.len());
        columns.iter_mut().for_each(|c| c.first += shared);
        let total = shared + columns.iter().map(|c| c.count).sum::<usize>();
        let locals = locals_of(&roles, &homes, clusters.len());
        let reduced: Result<Vec<Cluster>, ScoreError> = members
            .par_iter()
            .enumerate()
            .map(|(c, groups)| accumulate(graph, values, groups, &roles, locals[c], total))
            .collect();
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

/// The clusters in which a variable appears.
#[derive(Clone, Copy, PartialEq)]
enum Home {
    One(usize),
    Many,
}

impl Cluster {
    fn empty(columns: usize) -> Self {
        let zeros = DVector::zeros(columns);
        Self { hessian: DMatrix::zeros(columns, columns), gradient: zeros.clone(), alone: zeros, cost: 0.0, rows: 0 }
    }
}

fn is_fixed(graph: &Graph, id: VariableId, component: usize) -> bool {
    match graph.fixed(id) {
        None => false,
        Some(Fixed::All) => true,
        Some(Fixed::Mask(mask)) => mask.get(component).copied().unwrap_or(false),
    }
}

/// The candidates' columns, numbered from 0, and the column of each of their components.
#[allow(clippy::type_complexity)]
fn collect_candidates(
    graph: &Graph,
    values: &Values,
    candidates: &[Candidate],
) -> Result<(Vec<Columns>, HashMap<(VariableId, usize), usize>), ScoreError> {
    let (mut columns, mut owner, mut next) = (Vec::new(), HashMap::new(), 0);
    for candidate in candidates {
        let first = next;
        for id in &candidate.variables {
            let components = (0..values.dim(*id)).filter(|c| is_fixed(graph, *id, *c));
            let before = next;
            for component in components {
                owner.insert((*id, component), next);
                next += 1;
            }
            if next == before {
                let variable = graph.label_of(*id);
                return Err(ScoreError::NotFixed { candidate: candidate.name.clone(), variable });
            }
        }
        let count = next - first;
        if let Some(matrix) = &candidate.smoothness
            && matrix.shape() != (count, count)
        {
            let (candidate, rows) = (candidate.name.clone(), matrix.nrows());
            return Err(ScoreError::Smoothness { candidate, found: rows, expected: count });
        }
        let smoothness = candidate.smoothness.clone();
        columns.push(Columns { name: candidate.name.clone(), first, count, smoothness });
    }
    Ok((columns, owner))
}

type Roles = HashMap<VariableId, Vec<Role>>;

/// The role of every component of every variable, and the number of shared columns. Candidates follow the shared ones.
fn assign_roles(
    graph: &Graph,
    values: &Values,
    homes: &HashMap<VariableId, Home>,
    owner: &HashMap<(VariableId, usize), usize>,
    clusters: usize,
) -> (Roles, usize) {
    let mut ids: Vec<VariableId> = homes.keys().copied().collect();
    ids.sort_unstable();
    let (mut shared, mut local) = (0, vec![0; clusters]);
    let mut roles: Roles = HashMap::new();
    for id in ids {
        let components = (0..values.dim(id)).map(|component| match (is_fixed(graph, id, component), homes[&id]) {
            (true, _) => Role::None,
            (false, Home::One(cluster)) => {
                local[cluster] += 1;
                Role::Local(local[cluster] - 1)
            }
            (false, Home::Many) => {
                shared += 1;
                Role::Reduced(shared - 1)
            }
        });
        roles.insert(id, components.collect());
    }
    for ((id, component), column) in owner {
        if let Some(components) = roles.get_mut(id) {
            components[*component] = Role::Reduced(shared + column);
        }
    }
    (roles, shared)
}

/// Number of local components of every cluster; the last entry, of the groups that belong to no cluster, is 0.
fn locals_of(roles: &Roles, homes: &HashMap<VariableId, Home>, clusters: usize) -> Vec<usize> {
    let mut locals = vec![0; clusters + 1];
    for (id, components) in roles {
        if let Some(Home::One(cluster)) = homes.get(id) {
            locals[*cluster] += components.iter().filter(|r| matches!(r, Role::Local(_))).count();
        }
    }
    locals
}

/// Normal equations of a cluster's groups, with its local variables eliminated.
fn accumulate(
    graph: &Graph,
    values: &Values,
    groups: &[(BatchId, usize)],
    roles: &Roles,
    local: usize,
    reduced: usize,
) -> Result<Cluster, ScoreError> {
    let size = local + reduced;
    let mut hessian = DMatrix::<f64>::zeros(size, size);
    let mut gradient = DVector::<f64>::zeros(size);
    let (mut cost, mut count) = (0.0, 0);
    for (id, group) in groups {
        let Some(batch) = graph.batch(*id) else { continue };
        let rows = batch.row_count(*group);
        if rows == 0 {
            continue;
        }
        // The destination of each of the batch's columns.
        let target: Vec<Option<usize>> = batch
            .variables(*group)
            .iter()
            .flat_map(|v| roles[v].iter())
            .map(|role| match role {
                Role::None => None,
                Role::Local(i) => Some(*i),
                Role::Reduced(i) => Some(local + i),
            })
            .collect();
        let width = target.len();
        let (mut r, mut j) = (vec![0.0; rows], vec![0.0; rows * width]);
        batch.evaluate(*group, values, &mut r, Some(&mut j)).map_err(|source| EvaluationFailure {
            batch: batch.name().to_owned(),
            group: *group,
            source,
        })?;
        weight_rows(&batch.loss(), batch.residual_dim().max(1), width, &mut r, &mut j);
        cost += 0.5 * r.iter().map(|x| x * x).sum::<f64>();
        let used: Vec<usize> = (0..width).filter(|c| target[*c].is_some()).collect();
        let n = used.len();
        let compact: Vec<f64> = j.chunks_exact(width).flat_map(|row| used.iter().map(|c| row[*c])).collect();
        let (mut product, mut by_residual) = (vec![0.0; n * n], vec![0.0; n]);
        kernels::gram_lower(&compact, rows, n, &mut product);
        kernels::gram_vector(&compact, &r, n, &mut by_residual);
        let place: Vec<usize> = used.iter().filter_map(|c| target[*c]).collect();
        for (a, row) in place.iter().enumerate() {
            gradient[*row] += by_residual[a];
            for (b, to) in place[..=a].iter().enumerate() {
                hessian[(*row, *to)] += product[a * n + b];
                if a != b {
                    hessian[(*to, *row)] += product[a * n + b];
                }
            }
        }
        count += rows;
    }
    Ok(Cluster { cost, rows: count, ..eliminate(&hessian, &gradient, local) })
}

/// Multiplies every residual and its rows of the Jacobian by √ρ′. `r` has `dim` rows per residual; `j` is row-major with
/// `width` columns and as many rows as `r`.
fn weight_rows(loss: &Loss, dim: usize, width: usize, r: &mut [f64], j: &mut [f64]) {
    for (residual, rows) in r.chunks_exact_mut(dim).zip(j.chunks_exact_mut(dim * width)) {
        let weight = loss.evaluate(residual.iter().map(|x| x * x).sum())[1].max(0.0).sqrt();
        residual.iter_mut().chain(rows).for_each(|x| *x *= weight);
    }
}

/// Eliminates the first `local` columns by a Schur complement. Undetermined combinations of them are kept at their
/// values, by the pseudo-inverse.
fn eliminate(hessian: &DMatrix<f64>, gradient: &DVector<f64>, local: usize) -> Cluster {
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
