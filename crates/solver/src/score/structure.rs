//! Which variables belong to one cluster, which are shared, and where their columns are.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use super::pseudo_inverse::{NEGLIGIBLE, pseudo_inverse};
use crate::normal::kernels;
use crate::problem::error::EvaluationFailure;
use crate::problem::factor_batch::FactorBatch;
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

/// The columns of a candidate.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub name: String,
    pub first: usize,
    pub count: usize,
    pub smoothness: Option<DMatrix<f64>>,
}

impl Cluster {
    pub fn empty(columns: usize) -> Self {
        let zeros = DVector::zeros(columns);
        Self { hessian: DMatrix::zeros(columns, columns), gradient: zeros.clone(), alone: zeros, cost: 0.0, rows: 0 }
    }
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

/// The clusters in which a variable appears.
#[derive(Clone, Copy, PartialEq)]
enum Home {
    One(usize),
    Many,
}

type Roles = HashMap<VariableId, Vec<Role>>;

/// The groups of residuals of every cluster, and the columns of their variables.
pub(crate) struct Structure {
    /// Groups by cluster; the last entry has the groups that belong to none.
    members: Vec<Vec<(BatchId, usize)>>,
    roles: Roles,
    /// Number of every cluster's own components; the last entry is 0.
    locals: Vec<usize>,
    /// Number of shared columns.
    pub(super) shared: usize,
    /// Columns of the candidates, behind the shared ones.
    pub(super) candidates: Vec<Columns>,
}

impl Structure {
    /// The structure of `graph` with groups of residuals that depend on the variable `clusters[i]` in cluster i.
    pub(crate) fn of(
        graph: &Graph,
        values: &Values,
        clusters: &[VariableId],
        candidates: &[Candidate],
    ) -> Result<Self, ScoreError> {
        let cluster_of: HashMap<VariableId, usize> = clusters.iter().enumerate().map(|(i, id)| (*id, i)).collect();
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
        let (mut candidates, owner) = collect_candidates(graph, values, candidates)?;
        let (roles, shared) = assign_roles(graph, values, &homes, &owner, clusters.len());
        candidates.iter_mut().for_each(|c| c.first += shared);
        let locals = locals_of(&roles, &homes, clusters.len());
        Ok(Self { members, roles, locals, shared, candidates })
    }

    /// Number of shared columns and of those of the candidates.
    pub(super) fn reduced(&self) -> usize {
        self.shared + self.candidates.iter().map(|c| c.count).sum::<usize>()
    }

    /// Normal equations of a cluster, with its own variables eliminated.
    pub(super) fn accumulate(&self, graph: &Graph, values: &Values, cluster: usize) -> Result<Cluster, ScoreError> {
        let local = self.locals[cluster];
        let mut sum = Sum::zeros(local + self.reduced());
        for (id, group) in &self.members[cluster] {
            if let Some(batch) = graph.batch(*id).filter(|batch| batch.row_count(*group) > 0) {
                sum.add(&self.linearized(values, batch, *group, local)?);
            }
        }
        let Sum { hessian, gradient, cost, rows } = sum;
        Ok(Cluster { cost, rows, ..eliminate(&hessian, &gradient, local) })
    }

    /// The residuals of one batch in a cluster as rows, and the normal equations of all others in it; no candidates.
    pub(crate) fn rows(
        &self,
        graph: &Graph,
        values: &Values,
        cluster: usize,
        of_batch: BatchId,
    ) -> Result<BatchRows, ScoreError> {
        let local = self.locals[cluster];
        let size = local + self.shared;
        let (mut others, mut groups, mut numbers) = (Sum::zeros(size), Vec::new(), Vec::new());
        for (id, group) in &self.members[cluster] {
            let Some(batch) = graph.batch(*id).filter(|batch| batch.row_count(*group) > 0) else { continue };
            let linearized = self.linearized(values, batch, *group, local)?;
            if *id == of_batch {
                let first: usize = (0..*group).map(|before| batch.row_count(before)).sum();
                numbers.extend(first..first + linearized.residuals.len());
                groups.push(linearized);
            } else {
                others.add(&linearized);
            }
        }
        let mut jacobian = DMatrix::zeros(numbers.len(), size);
        let residuals = groups.iter().flat_map(|group| group.residuals.iter().copied());
        let residuals = DVector::from_iterator(numbers.len(), residuals);
        let mut row = 0;
        for Linearized { jacobian: of_group, places, .. } in &groups {
            for entries in of_group.chunks_exact(places.len().max(1)) {
                places.iter().zip(entries).for_each(|(column, entry)| jacobian[(row, *column)] = *entry);
                row += 1;
            }
        }
        let others = (others.hessian, others.gradient);
        Ok(BatchRows { jacobian, residuals, numbers, others, local })
    }

    /// The weighted residuals of a group and their derivatives.
    fn linearized(
        &self,
        values: &Values,
        batch: &dyn FactorBatch,
        group: usize,
        local: usize,
    ) -> Result<Linearized, ScoreError> {
        let rows = batch.row_count(group);
        // The destination of each of the batch's columns.
        let target: Vec<Option<usize>> = batch
            .variables(group)
            .iter()
            .flat_map(|v| self.roles[v].iter())
            .map(|role| match role {
                Role::None => None,
                Role::Local(i) => Some(*i),
                Role::Reduced(i) => Some(local + i),
            })
            .collect();
        let width = target.len();
        let (mut residuals, mut j) = (vec![0.0; rows], vec![0.0; rows * width]);
        batch.evaluate(group, values, &mut residuals, Some(&mut j)).map_err(|source| EvaluationFailure {
            batch: batch.name().to_owned(),
            group,
            source,
        })?;
        weight_rows(&batch.loss(), batch.residual_dim().max(1), width, &mut residuals, &mut j);
        let used: Vec<usize> = (0..width).filter(|c| target[*c].is_some()).collect();
        let jacobian = j.chunks_exact(width).flat_map(|row| used.iter().map(|c| row[*c])).collect();
        let places = used.iter().filter_map(|c| target[*c]).collect();
        Ok(Linearized { residuals, jacobian, places })
    }
}

/// The residuals of one batch in a cluster.
pub(crate) struct BatchRows {
    /// Derivatives by the cluster's own components and the shared ones.
    pub jacobian: DMatrix<f64>,
    pub residuals: DVector<f64>,
    /// The rows' numbers in the batch.
    pub numbers: Vec<usize>,
    /// Normal matrix and gradient of all other residuals of the cluster.
    pub others: (DMatrix<f64>, DVector<f64>),
    /// Number of the cluster's own components.
    pub local: usize,
}

/// A group's weighted residuals and its Jacobian by free components and candidates, row after row, with their columns.
struct Linearized {
    residuals: Vec<f64>,
    jacobian: Vec<f64>,
    places: Vec<usize>,
}

/// Normal equations of some groups.
struct Sum {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    cost: f64,
    rows: usize,
}

impl Sum {
    fn zeros(size: usize) -> Self {
        Self { hessian: DMatrix::zeros(size, size), gradient: DVector::zeros(size), cost: 0.0, rows: 0 }
    }

    fn add(&mut self, Linearized { residuals, jacobian, places }: &Linearized) {
        let (rows, n) = (residuals.len(), places.len());
        self.cost += 0.5 * residuals.iter().map(|x| x * x).sum::<f64>();
        let (mut product, mut by_residual) = (vec![0.0; n * n], vec![0.0; n]);
        kernels::gram_lower(jacobian, rows, n, &mut product);
        kernels::gram_vector(jacobian, residuals, n, &mut by_residual);
        let Self { hessian, gradient, .. } = self;
        for (a, row) in places.iter().enumerate() {
            gradient[*row] += by_residual[a];
            for (b, to) in places[..=a].iter().enumerate() {
                hessian[(*row, *to)] += product[a * n + b];
                if a != b {
                    hessian[(*to, *row)] += product[a * n + b];
                }
            }
        }
        self.rows += rows;
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
