//! Rotations, poses and directions as variables.

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};

use crate::problem::variable::Variable;

fn vector(delta: &[f64]) -> Vector3<f64> {
    Vector3::new(delta[0], delta[1], delta[2])
}

/// The inverse of the right Jacobian of SO(3): Log(Exp(φ) Exp(ε)) = φ + J ε + O(ε²) (Chirikjian 2012, eq. 10.86).
pub(crate) fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let theta = phi.norm();
    let hat = phi.cross_matrix();
    let c = if theta < 1e-4 {
        1.0 / 12.0 + theta * theta / 720.0
    } else {
        1.0 / (theta * theta) - (1.0 + theta.cos()) / (2.0 * theta * theta.sin())
    };
    Matrix3::identity() + hat * 0.5 + hat * hat * c
}

fn rotate_by(rotation: &UnitQuaternion<f64>, omega: Vector3<f64>) -> UnitQuaternion<f64> {
    let mut rotated = rotation * UnitQuaternion::from_scaled_axis(omega);
    if omega != Vector3::zeros() {
        // Products of unit quaternions drift from unit length by one rounding error each.
        rotated.renormalize_fast();
    }
    rotated
}

/// Whether a stored state is a unit vector. It is used as it is: normalising it again would change its last bits.
fn is_unit(state: &[f64]) -> bool {
    (state.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-6
}

/// SO(3), with R ← R · Exp(ω), ω in radians in the rotated (body) frame.
impl Variable for UnitQuaternion<f64> {
    fn dim(&self) -> usize {
        3
    }

    fn retract(&self, delta: &[f64]) -> Self {
        rotate_by(self, vector(delta))
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        delta[..3].copy_from_slice((self.inverse() * other).scaled_axis().as_slice());
    }

    fn local_jacobian(&self, other: &Self, jacobian: &mut [f64]) {
        let j = right_jacobian_inverse(&(self.inverse() * other).scaled_axis());
        for r in 0..3 {
            for c in 0..3 {
                jacobian[3 * r + c] = j[(r, c)];
            }
        }
    }

    fn state(&self) -> Option<Vec<f64>> {
        Some(self.coords.iter().copied().collect())
    }

    fn with_state(&self, state: &[f64]) -> Option<Self> {
        let &[i, j, k, w] = state else { return None };
        is_unit(state).then(|| UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)))
    }
}

/// SO(3) × R³, tangent (ω, τ): R ← R · Exp(ω), t ← t + τ.
///
/// Rotation and translation are retracted separately, which keeps the derivatives of a transformed point simple:
/// ∂(R x + t)/∂ω = −R \[x\]×, ∂(R x + t)/∂τ = I.
impl Variable for Isometry3<f64> {
    fn dim(&self) -> usize {
        6
    }

    fn retract(&self, delta: &[f64]) -> Self {
        let translation = Translation3::from(self.translation.vector + vector(&delta[3..]));
        Isometry3::from_parts(translation, rotate_by(&self.rotation, vector(delta)))
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        self.rotation.local(&other.rotation, &mut delta[..3]);
        delta[3..6].copy_from_slice((other.translation.vector - self.translation.vector).as_slice());
    }

    fn local_jacobian(&self, other: &Self, jacobian: &mut [f64]) {
        let j = right_jacobian_inverse(&(self.rotation.inverse() * other.rotation).scaled_axis());
        jacobian[..36].fill(0.0);
        for r in 0..3 {
            for c in 0..3 {
                jacobian[6 * r + c] = j[(r, c)];
            }
            jacobian[6 * (r + 3) + r + 3] = 1.0;
        }
    }

    /// Components 3 to 5 have coordinates: those of the translation.
    fn coordinate(&self, component: usize) -> Option<f64> {
        self.translation.vector.coordinate(component.checked_sub(3)?)
    }

    fn set_coordinate(&mut self, component: usize, value: f64) {
        if let Some(component) = component.checked_sub(3) {
            self.translation.vector.set_coordinate(component, value);
        }
    }

    fn state(&self) -> Option<Vec<f64>> {
        let mut state = self.rotation.state()?;
        state.extend(self.translation.vector.iter());
        Some(state)
    }

    fn with_state(&self, state: &[f64]) -> Option<Self> {
        let (rotation, translation) = state.split_at_checked(4)?;
        let translation = Translation3::from(self.translation.vector.with_state(translation)?);
        Some(Isometry3::from_parts(translation, self.rotation.with_state(rotation)?))
    }
}

/// Two unit vectors that complete the unit vector `n` to a right-handed orthonormal basis (Duff et al. 2017).
pub(crate) fn tangent_basis(n: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vector3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vector3::new(b, sign + n.y * n.y * a, -n.y)]
}

/// The unit sphere, by its exponential map: n ← cos‖δ‖ n + sin‖δ‖ B δ/‖δ‖ with B an orthonormal basis of n's tangent
/// plane, δ in radians.
impl Variable for Unit<Vector3<f64>> {
    fn dim(&self) -> usize {
        2
    }

    fn retract(&self, delta: &[f64]) -> Self {
        let [b0, b1] = tangent_basis(self);
        let tangent = b0 * delta[0] + b1 * delta[1];
        let angle = tangent.norm();
        if angle == 0.0 {
            return *self;
        }
        Unit::new_normalize(self.into_inner() * angle.cos() + tangent * (angle.sin() / angle))
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        let [b0, b1] = tangent_basis(self);
        let (u, v) = (b0.dot(other), b1.dot(other));
        let sine = u.hypot(v);
        let angle = sine.atan2(self.dot(other));
        // At the antipode the direction is arbitrary.
        let scale = if sine > 0.0 { angle / sine } else { 1.0 };
        delta[0] = if sine > 0.0 { u * scale } else { angle };
        delta[1] = v * scale;
    }

    fn state(&self) -> Option<Vec<f64>> {
        self.as_ref().state()
    }

    fn with_state(&self, state: &[f64]) -> Option<Self> {
        self.as_ref().with_state(state).filter(|_| is_unit(state)).map(Unit::new_unchecked)
    }
}
