//! A normal prior of a camera's parameters, from other units of its type.

use depthcal_io::Prior;
use depthcal_model::{Block, Camera};
use depthcal_solver::{EvaluationError, FactorBatch, Key, Values, VariableId};
use nalgebra::{DMatrix, DVector};

/// A normal prior of a camera's parameters, named `piece.parameter`: mean and covariance in the parameters' units.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPrior {
    /// Number of units that it comes from.
    pub units: usize,
    /// Names, `piece.parameter`.
    pub names: Vec<String>,
    /// Mean.
    pub mean: DVector<f64>,
    /// Covariance, positive definite.
    pub covariance: DMatrix<f64>,
}

/// The part of a prior that concerns a camera: its free parameters that the prior names.
pub struct PriorOfCamera {
    /// Places among [`Camera::theta`].
    pub places: Vec<usize>,
    /// Names, `piece.parameter`.
    pub names: Vec<String>,
    /// Mean.
    pub mean: DVector<f64>,
    /// Covariance: the marginal one where the prior has further parameters.
    pub covariance: DMatrix<f64>,
    /// L⁻¹ with covariance = L Lᵀ: L⁻¹ (θ − mean) is standard normal.
    pub whitening: DMatrix<f64>,
}

impl From<&Prior> for CameraPrior {
    fn from(file: &Prior) -> Self {
        let n = file.parameters.len();
        Self {
            units: file.units,
            names: file.parameters.clone(),
            mean: DVector::from_column_slice(&file.mean),
            covariance: DMatrix::from_fn(n, n, |i, k| 0.5 * (file.covariance[i][k] + file.covariance[k][i])),
        }
    }
}

impl CameraPrior {
    /// The part that concerns a camera; `None` where the prior names none of its free parameters, or its covariance is not
    /// positive definite.
    pub fn of(&self, camera: &Camera) -> Option<PriorOfCamera> {
        let place = |name: &str| self.names.iter().position(|own| own == name);
        let (mut places, mut rows) = (Vec::new(), Vec::new());
        for (block, range) in camera.blocks_with_ranges() {
            for (i, at) in range.enumerate().filter(|(i, _)| block.free[*i]) {
                if let Some(row) = place(&parameter_name(block, i)) {
                    places.push(at);
                    rows.push(row);
                }
            }
        }
        let mean = DVector::from_fn(rows.len(), |i, _| self.mean[rows[i]]);
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, k| self.covariance[(rows[i], rows[k])]);
        let names = rows.iter().map(|row| self.names[*row].clone()).collect();
        let whitening = whitening(&covariance)?;
        (!rows.is_empty()).then_some(PriorOfCamera { places, names, mean, covariance, whitening })
    }

    /// The camera with every parameter that the prior names at the prior's mean.
    #[must_use]
    pub fn start(&self, camera: &Camera) -> Camera {
        camera.map_blocks(|mut block| {
            for i in 0..block.theta.len() {
                if let Some(row) = self.names.iter().position(|name| *name == parameter_name(&block, i)) {
                    block.theta[i] = self.mean[row];
                }
            }
            block
        })
    }

    /// Mean of the parameter called `name`.
    pub fn mean_of(&self, name: &str) -> Option<f64> {
        self.names.iter().position(|own| own == name).map(|row| self.mean[row])
    }
}

impl PriorOfCamera {
    /// Its precision matrix over a camera's free parameters, and its pull on them (the gradient of its cost) at their present
    /// values.
    pub(crate) fn normal(&self, camera: &Camera) -> (DMatrix<f64>, DVector<f64>) {
        let free = camera.free_parameters();
        let theta = camera.theta();
        let n = free.len();
        let column = |at: usize| free.iter().position(|f| *f == at).unwrap_or(0);
        let columns: Vec<usize> = self.places.iter().map(|at| column(*at)).collect();
        let precision = self.whitening.tr_mul(&self.whitening);
        let deviation = DVector::from_fn(self.places.len(), |i, _| theta[self.places[i]] - self.mean[i]);
        let own_pull = &precision * deviation;
        let (mut normal, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (i, a) in columns.iter().enumerate() {
            pull[*a] += own_pull[i];
            for (k, b) in columns.iter().enumerate() {
                normal[(*a, *b)] += precision[(i, k)];
            }
        }
        (normal, pull)
    }
}

/// `piece.parameter` of a block's `i`-th parameter.
fn parameter_name(block: &Block, i: usize) -> String {
    format!("{}.{}", block.name(), block.parameters()[i].name)
}

/// L⁻¹ of a covariance L Lᵀ whose variances differ by many orders of magnitude; `None` where it is not positive definite.
fn whitening(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = covariance.nrows();
    let scale = covariance.diagonal().map(|v| 1.0 / v.max(f64::MIN_POSITIVE).sqrt());
    let correlation = DMatrix::from_fn(n, n, |i, k| scale[i] * covariance[(i, k)] * scale[k]);
    let inverse = correlation.cholesky()?.l().solve_lower_triangular(&DMatrix::identity(n, n))?;
    Some(DMatrix::from_fn(n, n, |i, k| inverse[(i, k)] * scale[k]))
}

/// The prior on the factor graph: one group over all blocks that it concerns.
pub(super) struct CameraPriorBatch {
    keys: Vec<Key<DVector<f64>>>,
    ids: Vec<VariableId>,
    /// Place of every parameter of the prior among the components of all variables.
    columns: Vec<usize>,
    mean: DVector<f64>,
    whitening: DMatrix<f64>,
}

impl CameraPriorBatch {
    /// The prior of a camera whose blocks are the variables `keys`; parameters of blocks without a variable of their own, `None`,
    /// are left out, which is possible only for large fields, of which no prior speaks.
    pub(super) fn new(camera: &Camera, keys: &[Option<Key<DVector<f64>>>], prior: &CameraPrior) -> Option<Self> {
        let part = prior.of(camera)?;
        let (mut used, mut columns, mut width) = (Vec::new(), vec![usize::MAX; part.places.len()], 0);
        for ((_, range), key) in camera.blocks_with_ranges().zip(keys) {
            let places_of_block: Vec<usize> =
                (0..part.places.len()).filter(|i| range.contains(&part.places[*i])).collect();
            if places_of_block.is_empty() {
                continue;
            }
            used.push((*key)?);
            for i in places_of_block {
                columns[i] = width + part.places[i] - range.start;
            }
            width += range.len();
        }
        let ids = used.iter().map(|key| key.id()).collect();
        Some(Self { keys: used, ids, columns, mean: part.mean, whitening: part.whitening })
    }
}

impl FactorBatch for CameraPriorBatch {
    fn name(&self) -> &str {
        "prior of the camera"
    }

    fn group_count(&self) -> usize {
        1
    }

    fn variables(&self, _: usize) -> &[VariableId] {
        &self.ids
    }

    fn row_count(&self, _: usize) -> usize {
        self.mean.len()
    }

    fn evaluate(
        &self,
        _: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let theta: Vec<f64> = self.keys.iter().flat_map(|key| values.get(*key).iter().copied()).collect();
        let deviation = DVector::from_fn(self.mean.len(), |i, _| theta[self.columns[i]] - self.mean[i]);
        residuals.copy_from_slice((&self.whitening * deviation).as_slice());
        if let Some(jacobian) = jacobian {
            jacobian.fill(0.0);
            for (row, j) in jacobian.chunks_exact_mut(theta.len()).enumerate() {
                for (i, column) in self.columns.iter().enumerate() {
                    j[*column] = self.whitening[(row, i)];
                }
            }
        }
        Ok(())
    }
}
