//! Gaussian priors on variables.

use nalgebra::{DMatrix, DVector};

use crate::problem::error::EvaluationError;
use crate::problem::factor_batch::FactorBatch;
use crate::problem::key::{Key, VariableId};
use crate::problem::noise::NoiseError;
use crate::problem::values::Values;
use crate::problem::variable::Variable;

/// A Gaussian prior on one variable x: r = A · mean.local(x), in the tangent space of the mean, with AᵀA = Σ⁻¹.
#[derive(Clone, Debug)]
pub struct Prior<V> {
    name: String,
    key: Key<V>,
    id: [VariableId; 1],
    mean: V,
    square_root_information: DMatrix<f64>,
}

impl<V: Variable> Prior<V> {
    /// A prior with one standard deviation for all tangent components.
    ///
    /// # Errors
    /// If the standard deviation is not positive.
    pub fn isotropic(name: impl Into<String>, key: Key<V>, mean: V, sigma: f64) -> Result<Self, NoiseError> {
        let sigmas = vec![sigma; mean.dim()];
        Self::diagonal(name, key, mean, &sigmas)
    }

    /// One standard deviation per tangent component; infinity where nothing is known, which also holds for components beyond
    /// the end of `sigmas`.
    ///
    /// # Errors
    /// If a standard deviation is not positive.
    pub fn diagonal(name: impl Into<String>, key: Key<V>, mean: V, sigmas: &[f64]) -> Result<Self, NoiseError> {
        if let Some(component) = sigmas.iter().position(|s| s.is_nan() || *s <= 0.0) {
            return Err(NoiseError::Sigma { component, sigma: sigmas[component] });
        }
        let weights = DVector::from_fn(mean.dim(), |i, _| sigmas.get(i).map_or(0.0, |s| 1.0 / s));
        Self::square_root_information(name, key, mean, DMatrix::from_diagonal(&weights))
    }

    /// A full square-root information matrix A with AᵀA = Σ⁻¹. It has one column per tangent component, and may have fewer
    /// rows.
    ///
    /// # Errors
    /// If A is not finite or has another number of columns than `mean` has tangent components.
    pub fn square_root_information(
        name: impl Into<String>,
        key: Key<V>,
        mean: V,
        a: DMatrix<f64>,
    ) -> Result<Self, NoiseError> {
        if a.ncols() != mean.dim() || a.iter().any(|v| !v.is_finite()) {
            return Err(NoiseError::NotFinite);
        }
        Ok(Self { name: name.into(), key, id: [key.id()], mean, square_root_information: a })
    }
}

impl<V: Variable> FactorBatch for Prior<V> {
    fn name(&self) -> &str {
        &self.name
    }

    fn group_count(&self) -> usize {
        1
    }

    fn variables(&self, _: usize) -> &[VariableId] {
        &self.id
    }

    fn row_count(&self, _: usize) -> usize {
        self.square_root_information.nrows()
    }

    fn residual_dim(&self) -> usize {
        self.square_root_information.nrows().max(1)
    }

    fn evaluate(
        &self,
        _: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let x =
            values.try_get(self.key).ok_or(EvaluationError::new("the prior's variable is not among these values"))?;
        let (a, n) = (&self.square_root_information, self.mean.dim());
        if x.dim() != n {
            return Err(EvaluationError::new("the variable has another dimension than the mean of its prior"));
        }
        let (mut delta, mut local) = (Scratch::new(n), Scratch::new(n * n));
        let delta = delta.get(n);
        self.mean.local(x, delta);
        for (row, r) in residuals.iter_mut().enumerate() {
            *r = (0..n).map(|k| a[(row, k)] * delta[k]).sum();
        }
        if let Some(jacobian) = jacobian {
            let local = local.get(n * n);
            self.mean.local_jacobian(x, local);
            for row in 0..a.nrows() {
                for column in 0..n {
                    jacobian[row * n + column] = (0..n).map(|k| a[(row, k)] * local[k * n + column]).sum();
                }
            }
        }
        Ok(())
    }
}

/// A buffer of `n` numbers: on the stack if it is small, so that evaluating a prior does not allocate.
struct Scratch {
    few: [f64; 144],
    many: Vec<f64>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        let few = [0.0; 144];
        let many = if n > few.len() { vec![0.0; n] } else { Vec::new() };
        Self { few, many }
    }

    fn get(&mut self, n: usize) -> &mut [f64] {
        if self.many.is_empty() { &mut self.few[..n] } else { &mut self.many }
    }
}
