//! Covariances of the estimated variables.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use thiserror::Error;

use crate::error::{EvaluationFailure, StructureError};
use crate::graph::Graph;
use crate::inverse::Inverse;
use crate::layout::Layout;
use crate::normal::NormalEquations;
use crate::options::LinearSolver;
use crate::selected::{Selected, orthonormalize};
use crate::undetermined::null_space;
use crate::values::{Values, VariableId};

/// Relative curvature of undetermined combinations: rounding errors of normal equations leave less, and those of a
/// factorisation of the Jacobian the square of that.
const TOLERANCE: f64 = 1e-12;
const ROWS_TOLERANCE: f64 = 1e-24;

/// How a [`Covariance`] is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct CovarianceOptions {
    /// A combination of variables counts as undetermined when its curvature is at most this, relative to the curvature
    /// that its variables would have if they were alone (eigenvalues of H scaled to a unit diagonal). Default 1e-12.
    pub rank_tolerance: f64,
    /// Give the Moore–Penrose pseudo-inverse of H instead of an error where combinations are undetermined. It is the
    /// covariance under the condition that these combinations do not vary: gauge freedom leaves no trace.
    pub pseudo_inverse: bool,
}

impl Default for CovarianceOptions {
    fn default() -> Self {
        Self { rank_tolerance: TOLERANCE, pseudo_inverse: false }
    }
}

/// A component of an undetermined combination.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullComponent {
    /// The variable.
    #[serde(skip)]
    pub variable: VariableId,
    /// Its label.
    pub label: String,
    /// Tangent component.
    pub component: usize,
    /// How far it moves.
    pub value: f64,
}

/// A combination of variables that the residuals do not determine: a unit vector of the tangent space along which the cost
/// does not change, to second order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullDirection {
    /// Components that matter, the most influential on the residuals first.
    pub components: Vec<NullComponent>,
}

impl fmt::Display for NullDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 6;
        for (i, c) in self.components.iter().take(SHOWN).enumerate() {
            let sign = if c.value < 0.0 { "-" } else { "+" };
            let separator = if i > 0 { " " } else { "" };
            write!(f, "{separator}{sign}{:.3e} {}[{}]", c.value.abs(), c.label, c.component)?;
        }
        match self.components.len().checked_sub(SHOWN) {
            None | Some(0) => Ok(()),
            Some(more) => write!(f, " and {more} more"),
        }
    }
}

/// There is no covariance.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CovarianceError {
    /// Graph and values do not fit together.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// The factors cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] EvaluationFailure),
    /// Some combinations of variables are not determined by the residuals.
    #[error("{} combinations of variables are not determined: {}", directions.len(), join(directions))]
    RankDeficient {
        /// A basis of these combinations.
        directions: Vec<NullDirection>,
    },
    /// The eigenvalues of the reduced system were not found.
    #[error("the eigenvalues of the normal equations were not found")]
    Eigenvalues,
}

fn join(directions: &[NullDirection]) -> String {
    let shown: Vec<_> = directions.iter().take(4).map(|d| format!("({d})")).collect();
    let more = if directions.len() > 4 { ", …" } else { "" };
    shown.join(", ") + more
}

/// Covariances of estimated variables: blocks of H⁻¹, H = Jᵀ W J at the given values, without damping.
///
/// In the tangent coordinates of the retractions. It is the covariance of the estimate to first order if residuals are
/// whitened by the true noise; multiply by [`variance_factor`](Self::variance_factor) if only the noise's shape is known.
/// With a robust loss, W holds the weights ρ′. A component on a bound across which the cost falls counts as fixed.
#[derive(Clone)]
pub struct Covariance {
    layout: Layout,
    inverse: Kind,
    dims: Vec<usize>,
    used: Vec<bool>,
    cost: f64,
}

#[derive(Clone)]
enum Kind {
    Whole(Inverse),
    Selected(Selected),
}

impl Kind {
    fn null(&self) -> &[DVector<f64>] {
        match self {
            Kind::Whole(inverse) => &inverse.null,
            Kind::Selected(selected) => &selected.null,
        }
    }
}

impl fmt::Debug for Covariance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Covariance").field("unknowns", &self.layout.dim()).finish_non_exhaustive()
    }
}

impl Covariance {
    /// Linearises at `values` and inverts the normal equations. Of any variables covariances are then at hand. What a Schur
    /// complement leaves is inverted as a dense matrix; for large sparse problems see [`selected`](Self::selected).
    ///
    /// # Errors
    /// [`CovarianceError::RankDeficient`] if combinations of variables are undetermined and no pseudo-inverse is asked for;
    /// others if the graph cannot be evaluated.
    pub fn compute(graph: &Graph, values: &Values, options: &CovarianceOptions) -> Result<Covariance, CovarianceError> {
        let (system, cost) = linearized(graph, values, LinearSolver::DenseSchur)?;
        let inverse = Inverse::new(&system, options.rank_tolerance).ok_or(CovarianceError::Eigenvalues)?;
        Self::new(graph, values, options, system, cost, Kind::Whole(inverse))
    }

    /// The covariances of chosen variables, with each other as well, from a sparse factorisation: for problems too large for
    /// [`compute`](Self::compute), such as graphs of many poses. Of other variables they are not a number.
    ///
    /// It takes the factorisation and two triangular solutions for each component chosen.
    ///
    /// # Errors
    /// Like [`compute`](Self::compute).
    pub fn selected(
        graph: &Graph,
        values: &Values,
        variables: &[VariableId],
        options: &CovarianceOptions,
    ) -> Result<Covariance, CovarianceError> {
        let (mut system, cost) = linearized(graph, values, LinearSolver::SparseCholesky)?;
        let place = |id: &VariableId| system.layout.find(*id).map(|a| (a.offset, a.free as usize));
        let mut chosen: Vec<(usize, usize)> = variables.iter().filter_map(place).collect();
        chosen.sort_unstable();
        chosen.dedup();
        let selected =
            Selected::new(&mut system, &chosen, options.rank_tolerance).ok_or(CovarianceError::Eigenvalues)?;
        Self::new(graph, values, options, system, cost, Kind::Selected(selected))
    }

    fn new(
        graph: &Graph,
        values: &Values,
        options: &CovarianceOptions,
        system: NormalEquations,
        cost: f64,
        inverse: Kind,
    ) -> Result<Self, CovarianceError> {
        if !options.pseudo_inverse && !inverse.null().is_empty() {
            let directions = inverse.null().iter().map(|v| name_direction(graph, &system, v)).collect();
            return Err(CovarianceError::RankDeficient { directions });
        }
        let dims = values.ids().map(|id| values.dim(id)).collect();
        let mut used = vec![false; values.len()];
        for (_, batch) in graph.batches() {
            for group in 0..batch.group_count() {
                batch.variables(group).iter().for_each(|id| used[id.index()] = true);
            }
        }
        Ok(Covariance { layout: system.layout, inverse, dims, used, cost })
    }

    /// The joint covariance of these variables, Σ dim × Σ dim in their order, cross-covariances included.
    ///
    /// Fixed components have zeros. A variable that no factor is about has infinity on its diagonal.
    pub fn joint(&self, variables: &[VariableId]) -> DMatrix<f64> {
        let dims: Vec<usize> = variables.iter().map(|v| self.dims.get(v.index()).copied().unwrap_or(0)).collect();
        let n = dims.iter().sum();
        let mut joint = DMatrix::zeros(n, n);
        // Rows of the joint matrix for every free component of every active variable asked for.
        let mut active = Vec::new();
        let mut first = 0;
        for (variable, dim) in variables.iter().zip(&dims) {
            if let Some(a) = self.layout.find(*variable) {
                let rows: Vec<usize> = match &a.mask {
                    None => (first..first + dim).collect(),
                    Some(mask) => mask.iter().map(|i| first + *i as usize).collect(),
                };
                active.push((a, rows));
            } else if !self.used.get(variable.index()).copied().unwrap_or(false) {
                (first..first + dim).for_each(|i| joint[(i, i)] = f64::INFINITY);
            }
            first += dim;
        }
        for (k, (a, rows)) in active.iter().enumerate() {
            for (b, columns) in &active[..=k] {
                let block = match &self.inverse {
                    Kind::Whole(inverse) => inverse.block(&self.layout, a, b),
                    Kind::Selected(selected) => selected.block(a, b),
                };
                for (i, row) in rows.iter().enumerate() {
                    for (j, column) in columns.iter().enumerate() {
                        joint[(*row, *column)] = block[(i, j)];
                        joint[(*column, *row)] = block[(i, j)];
                    }
                }
            }
        }
        joint
    }

    /// The covariance of one variable, dim × dim.
    pub fn marginal(&self, variable: impl Into<VariableId>) -> DMatrix<f64> {
        self.joint(&[variable.into()])
    }

    /// The square roots of the diagonal of [`marginal`](Self::marginal).
    pub fn standard_deviations(&self, variable: impl Into<VariableId>) -> DVector<f64> {
        self.marginal(variable).diagonal().map(f64::sqrt)
    }

    /// Number of undetermined combinations that the pseudo-inverse left out.
    pub fn nullity(&self) -> usize {
        self.inverse.null().len()
    }

    /// The estimated variance of the whitened residuals, 2 · cost / degrees of freedom; 1 where the noise model is right and
    /// the loss trivial. Not a number without degrees of freedom.
    pub fn variance_factor(&self) -> f64 {
        2.0 * self.cost / self.degrees_of_freedom() as f64
    }

    /// Scalar residuals minus determined unknowns.
    pub fn degrees_of_freedom(&self) -> isize {
        self.layout.rows as isize - (self.layout.dim() - self.nullity()) as isize
    }
}

/// The combinations that the residuals do not determine at these values, by QR of the Jacobian or by the Cholesky
/// factorisation of its normal equations. Nothing if there is no factorisation.
pub(crate) fn undetermined(
    graph: &Graph,
    values: &Values,
    by_rows: bool,
) -> Result<Option<Vec<NullDirection>>, CovarianceError> {
    let (linear_solver, tolerance) =
        if by_rows { (LinearSolver::SparseQr, ROWS_TOLERANCE) } else { (LinearSolver::SparseCholesky, TOLERANCE) };
    let (mut system, _) = linearized(graph, values, linear_solver)?;
    let Some(mut null) = null_space(&mut system, tolerance) else { return Ok(None) };
    orthonormalize(&mut null);
    Ok(Some(null.iter().map(|v| name_direction(graph, &system, v)).collect()))
}

/// The normal equations at these values, components at active bounds fixed, and the cost.
fn linearized(
    graph: &Graph,
    values: &Values,
    linear_solver: LinearSolver,
) -> Result<(NormalEquations, f64), CovarianceError> {
    let mut system = NormalEquations::new(graph, values, linear_solver, true)?;
    let mut cost = system.linearize(values)?;
    let active = system.bounds.active(values, system.gradient());
    if !active.is_empty() {
        let mut fixed = graph.clone();
        active.iter().for_each(|(id, component)| fixed.fix_component(*id, *component, values.dim(*id)));
        system = NormalEquations::new(&fixed, values, linear_solver, true)?;
        cost = system.linearize(values)?;
    }
    Ok((system, cost))
}

/// Writes a null vector in terms of variables.
fn name_direction(graph: &Graph, system: &NormalEquations, vector: &DVector<f64>) -> NullDirection {
    // Influence on the residuals, each component alone; components without any still count by their size.
    let weight = |i: usize| vector[i].abs() * system.diagonal()[i].sqrt();
    let largest = (0..vector.len()).map(weight).fold(0.0, f64::max);
    let size = vector.amax();
    let mut components = Vec::new();
    for active in &system.layout.active {
        for k in 0..active.free as usize {
            let i = active.offset + k;
            let relevant = if largest > 0.0 { weight(i) > 1e-4 * largest } else { vector[i].abs() > 1e-4 * size };
            if relevant {
                let component = active.mask.as_ref().map_or(k, |m| m[k] as usize);
                let label = graph.label_of(active.id);
                components.push((weight(i), NullComponent { variable: active.id, label, component, value: vector[i] }));
            }
        }
    }
    components.sort_by(|a, b| b.0.total_cmp(&a.0));
    NullDirection { components: components.into_iter().map(|c| c.1).collect() }
}
