//! What may be estimated: points of a smooth manifold with a retraction.

use std::fmt::Debug;

use nalgebra::{DVector, SVector};

/// A variable (parameter block): a point x of a smooth manifold with a local parameterisation around x.
///
/// The solver moves a variable only by [`retract`](Self::retract) and differentiates residuals with respect to δ at δ = 0,
/// so the choice of the retraction is the choice of tangent coordinates in which gradients, steps and covariances are
/// expressed.
///
/// Laws: `retract(0) = self`; `local(other)` is the inverse of `retract` in a neighbourhood of `self`; both are smooth at
/// δ = 0 and [`dim`](Self::dim) is not changed by `retract`.
pub trait Variable: Clone + Send + Sync + Debug + 'static {
    /// Dimension of the tangent space.
    fn dim(&self) -> usize;

    /// The point reached from `self` by the tangent vector `delta`, of length [`dim`](Self::dim).
    #[must_use]
    fn retract(&self, delta: &[f64]) -> Self;

    /// Writes the `delta`, of length [`dim`](Self::dim), for which `self.retract(delta)` is `other`.
    fn local(&self, other: &Self, delta: &mut [f64]);

    /// The derivative of `self.local(other.retract(ε))` with respect to ε at ε = 0, row-major dim × dim.
    ///
    /// Priors need it. The default takes central differences with a relative error of about 1e-10; implementations
    /// with a closed form override it.
    fn local_jacobian(&self, other: &Self, jacobian: &mut [f64]) {
        let n = self.dim();
        let step = f64::EPSILON.cbrt();
        let mut epsilon = vec![0.0; n];
        let (mut above, mut below) = (vec![0.0; n], vec![0.0; n]);
        for j in 0..n {
            epsilon[j] = step;
            self.local(&other.retract(&epsilon), &mut above);
            epsilon[j] = -step;
            self.local(&other.retract(&epsilon), &mut below);
            epsilon[j] = 0.0;
            for i in 0..n {
                jacobian[i * n + j] = (above[i] - below[i]) / (2.0 * step);
            }
        }
    }

    /// A coordinate of the point that a retraction by δ moves by exactly δᵢ, i the component. Only such components can be
    /// bounded: see [`Graph::bound`](crate::Graph::bound). By default there are none.
    fn coordinate(&self, component: usize) -> Option<f64> {
        let _ = component;
        None
    }

    /// Replaces a [`coordinate`](Self::coordinate). By default, and for other components, it does nothing.
    fn set_coordinate(&mut self, component: usize, value: f64) {
        let _ = (component, value);
    }

    /// Numbers from which [`with_state`](Self::with_state) makes the same point again, to the bit; a
    /// [`CheckpointFile`](crate::CheckpointFile) stores them. By default there are none, and saving a checkpoint is an
    /// error that names the type.
    fn state(&self) -> Option<Vec<f64>> {
        None
    }

    /// The point that has this [`state`](Self::state); `self` gives what the numbers do not say, such as a size. Nothing
    /// if they are not the state of such a point.
    #[must_use]
    fn with_state(&self, state: &[f64]) -> Option<Self> {
        let _ = state;
        None
    }
}

fn write_identity(n: usize, jacobian: &mut [f64]) {
    jacobian.fill(0.0);
    for i in 0..n {
        jacobian[i * n + i] = 1.0;
    }
}

/// Euclidean space of static dimension: x + δ.
impl<const N: usize> Variable for SVector<f64, N> {
    fn dim(&self) -> usize {
        N
    }

    fn retract(&self, delta: &[f64]) -> Self {
        Self::from_fn(|i, _| self[i] + delta[i])
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        for i in 0..N {
            delta[i] = other[i] - self[i];
        }
    }

    fn local_jacobian(&self, _: &Self, jacobian: &mut [f64]) {
        write_identity(N, jacobian);
    }

    fn coordinate(&self, component: usize) -> Option<f64> {
        self.get(component).copied()
    }

    fn set_coordinate(&mut self, component: usize, value: f64) {
        if let Some(x) = self.get_mut(component) {
            *x = value;
        }
    }

    fn state(&self) -> Option<Vec<f64>> {
        Some(self.iter().copied().collect())
    }

    fn with_state(&self, state: &[f64]) -> Option<Self> {
        (state.len() == N).then(|| Self::from_column_slice(state))
    }
}

/// Euclidean space whose dimension is known at run time: x + δ.
impl Variable for DVector<f64> {
    fn dim(&self) -> usize {
        self.len()
    }

    fn retract(&self, delta: &[f64]) -> Self {
        DVector::from_fn(self.len(), |i, _| self[i] + delta[i])
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        for (d, (o, s)) in delta.iter_mut().zip(other.iter().zip(self.iter())) {
            *d = o - s;
        }
    }

    fn local_jacobian(&self, _: &Self, jacobian: &mut [f64]) {
        write_identity(self.len(), jacobian);
    }

    fn coordinate(&self, component: usize) -> Option<f64> {
        self.get(component).copied()
    }

    fn set_coordinate(&mut self, component: usize, value: f64) {
        if let Some(x) = self.get_mut(component) {
            *x = value;
        }
    }

    fn state(&self) -> Option<Vec<f64>> {
        Some(self.iter().copied().collect())
    }

    fn with_state(&self, state: &[f64]) -> Option<Self> {
        (state.len() == self.len()).then(|| DVector::from_column_slice(state))
    }
}
