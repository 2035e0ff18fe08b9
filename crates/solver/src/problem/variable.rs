//! The trait of variables: points of a smooth manifold with a retraction.

use std::fmt::Debug;

/// A variable (parameter block): a point x of a smooth manifold with a local parameterisation around x.
///
/// The solver moves a variable only by [`retract`](Self::retract) and differentiates residuals with respect to δ at δ = 0.
/// The retraction therefore defines the tangent coordinates of gradients, steps and covariances.
///
/// Laws: `retract(0) = self`; `local(other)` is the inverse of `retract` in a neighbourhood of `self`; both are smooth at
/// δ = 0; `retract` preserves [`dim`](Self::dim).
pub trait Variable: Clone + Send + Sync + Debug + 'static {
    /// Dimension of the tangent space.
    fn dim(&self) -> usize;

    /// The point reached from `self` by the tangent vector `delta`, of length [`dim`](Self::dim).
    #[must_use]
    fn retract(&self, delta: &[f64]) -> Self;

    /// Writes the tangent vector `delta`, of length [`dim`](Self::dim), for which `self.retract(delta)` is `other`.
    fn local(&self, other: &Self, delta: &mut [f64]);

    /// Writes the derivative of `self.local(other.retract(ε))` with respect to ε at ε = 0: `jacobian` is row-major,
    /// [`dim`](Self::dim) × [`dim`](Self::dim).
    ///
    /// Only [`Prior`](crate::Prior) uses it. The default takes central differences, with a relative error of about 1e-10;
    /// override it where there is a closed form.
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

    /// The coordinate that belongs to a tangent component: a number that `retract(δ)` changes by exactly δᵢ, where i is the
    /// component. Only components with a coordinate can be bounded: see [`Graph::bound`](crate::Graph::bound). The default
    /// has none.
    fn coordinate(&self, component: usize) -> Option<f64> {
        let _ = component;
        None
    }

    /// Sets a [`coordinate`](Self::coordinate); does nothing for a component without one. The default does nothing.
    fn set_coordinate(&mut self, component: usize, value: f64) {
        let _ = (component, value);
    }

    /// Numbers from which [`with_state`](Self::with_state) restores the same point, bit by bit; a
    /// [`CheckpointFile`](crate::CheckpointFile) stores them. The default has none: saving a checkpoint is then an error
    /// that names the type.
    fn state(&self) -> Option<Vec<f64>> {
        None
    }

    /// The point with this [`state`](Self::state); `self` supplies what the numbers do not hold, such as the dimension.
    /// `None` if the numbers are not the state of a point of this type and dimension.
    #[must_use]
    fn with_state(&self, state: &[f64]) -> Option<Self> {
        let _ = state;
        None
    }
}
