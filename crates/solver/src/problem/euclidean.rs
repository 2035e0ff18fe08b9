//! Vectors of static and of dynamic dimension as variables.

use nalgebra::{DVector, SVector};

use crate::problem::variable::Variable;

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
