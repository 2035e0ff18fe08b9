//! Covariances of the estimated variables.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use crate::normal::normal_equations::NormalEquations;
use crate::normal::selected_inverse::SelectedInverse;
use crate::plan::layout::Layout;
use crate::plan::linear_solver::LinearSolver;
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;
use crate::problem::values::Values;
use crate::uncertainty::error::CovarianceError;
use crate::uncertainty::inverse::Inverse;
use crate::uncertainty::linearized::linearized;
use crate::uncertainty::null_direction::name_direction;
use crate::uncertainty::null_space::{RANK_TOLERANCE, null_space};
use crate::uncertainty::selected::Selected;

/// Options of [`Covariance`].
#[derive(Clone, Debug, PartialEq)]
pub struct CovarianceOptions {
    /// A combination of variables counts as undetermined if its eigenvalue of H, scaled to a unit diagonal, is at most this.
    /// Default 1e-12.
    pub rank_tolerance: f64,
    /// If combinations are undetermined, return the Moore–Penrose pseudo-inverse of H instead of an error: the covariance
    /// under the condition that these combinations do not vary. It does not depend on how a gauge freedom is fixed.
    /// Default false.
    pub pseudo_inverse: bool,
}

impl Default for CovarianceOptions {
    fn default() -> Self {
        Self { rank_tolerance: RANK_TOLERANCE, pseudo_inverse: false }
    }
}

/// Covariances of estimated variables: blocks of H⁻¹ with H = Jᵀ W J at the given values, without damping.
///
/// Rows and columns are tangent components. To first order this is the covariance of the estimate if residuals are
/// whitened by the true noise; if the noise is known only up to a factor, multiply by
/// [`variance_factor`](Self::variance_factor). With a robust loss, W holds the weights ρ′. A component on a bound across
/// which the cost falls counts as fixed.
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
    Marginals(SelectedInverse),
}

impl Kind {
    fn null(&self) -> &[DVector<f64>] {
        match self {
            Kind::Whole(inverse) => &inverse.null,
            Kind::Selected(selected) => &selected.null,
            Kind::Marginals(_) => &[],
        }
    }
}

impl fmt::Debug for Covariance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Covariance").field("unknowns", &self.layout.dim()).finish_non_exhaustive()
    }
}

impl Covariance {
    /// Linearises at `values` and inverts the normal equations, for covariances of any variables. The reduced system of a
    /// Schur complement is inverted as a dense matrix; for large sparse problems see [`selected`](Self::selected).
    ///
    /// # Errors
    /// [`CovarianceError::RankDeficient`] if combinations of variables are undetermined and
    /// [`pseudo_inverse`](CovarianceOptions::pseudo_inverse) is false; others if graph and values do not fit together or
    /// cannot be evaluated.
    pub fn compute(graph: &Graph, values: &Values, options: &CovarianceOptions) -> Result<Covariance, CovarianceError> {
        let (system, cost) = linearized(graph, values, LinearSolver::DenseSchur)?;
        let inverse = Inverse::new(&system, options.rank_tolerance).ok_or(CovarianceError::Eigenvalues)?;
        Self::new(graph, values, options, system, cost, Kind::Whole(inverse))
    }

    /// Computes the joint covariance of some variables from a sparse factorisation, for problems too large for
    /// [`compute`](Self::compute) such as graphs of many poses. Covariances of other variables are NaN. For all variables see
    /// [`marginals`](Self::marginals).
    ///
    /// The work is one factorisation and two triangular solves per component of these variables.
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

    /// Computes the covariance of every variable, and of every pair of variables that a factor links, from a sparse
    /// factorisation: for all nodes of a large field, or all poses of a large graph. Covariances of other pairs are NaN unless
    /// the factor happens to have them.
    ///
    /// The work is about three factorisations, whatever the number of variables, and the memory that of one more factor.
    ///
    /// # Errors
    /// Like [`compute`](Self::compute), and [`CovarianceError::RankDeficient`] with `pseudo_inverse` as well: fix the gauge, or
    /// use [`selected`](Self::selected).
    pub fn marginals(
        graph: &Graph,
        values: &Values,
        options: &CovarianceOptions,
    ) -> Result<Covariance, CovarianceError> {
        let (mut system, cost) = linearized(graph, values, LinearSolver::SparseCholesky)?;
        let null = null_space(&mut system, options.rank_tolerance).ok_or(CovarianceError::Eigenvalues)?;
        if !null.is_empty() {
            let directions = null.iter().map(|v| name_direction(graph, &system, v)).collect();
            return Err(CovarianceError::RankDeficient { directions });
        }
        let none = vec![0.0; system.dim()];
        if !system.factorize(0.0, &none) {
            return Err(CovarianceError::Eigenvalues);
        }
        match system.selected_inverse() {
            Some(inverse) => Self::new(graph, values, options, system, cost, Kind::Marginals(inverse)),
            None => Self::compute(graph, values, options),
        }
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

    /// The joint covariance of these variables, cross-covariances included: one row and column per tangent component, in the
    /// order of the variables.
    ///
    /// Rows and columns of fixed components are zero. A variable on which no factor depends has infinity on its diagonal.
    pub fn joint(&self, variables: &[VariableId]) -> DMatrix<f64> {
        let dims: Vec<usize> = variables.iter().map(|v| self.dims.get(v.index()).copied().unwrap_or(0)).collect();
        let n = dims.iter().sum();
        let mut joint = DMatrix::zeros(n, n);
        // Rows of the joint matrix of the free components of each active variable.
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
                    Kind::Marginals(inverse) => inverse.block((a.offset, a.free as usize), (b.offset, b.free as usize)),
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

    /// The covariance of one variable, dim × dim for its tangent dimension dim.
    pub fn marginal(&self, variable: impl Into<VariableId>) -> DMatrix<f64> {
        self.joint(&[variable.into()])
    }

    /// The standard deviations of a variable's tangent components: square roots of the diagonal of
    /// [`marginal`](Self::marginal).
    pub fn standard_deviations(&self, variable: impl Into<VariableId>) -> DVector<f64> {
        self.marginal(variable).diagonal().map(f64::sqrt)
    }

    /// Number of undetermined combinations, the dimension of the null space of H. Zero unless the pseudo-inverse was used.
    pub fn nullity(&self) -> usize {
        self.inverse.null().len()
    }

    /// The estimated variance of the whitened residuals, 2 · cost / degrees of freedom. Its expectation is 1 if the noise
    /// model is right and the loss trivial. NaN or infinite without degrees of freedom.
    pub fn variance_factor(&self) -> f64 {
        2.0 * self.cost / self.degrees_of_freedom() as f64
    }

    /// Number of scalar residuals minus number of determined unknowns.
    pub fn degrees_of_freedom(&self) -> isize {
        self.layout.rows as isize - (self.layout.dim() - self.nullity()) as isize
    }
}
