//! Rotations and rigid motions over dual numbers.

use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};

use crate::problem::autodiff::{AutoDiffVariable, Scalar};

/// A rotation, as a unit quaternion over the scalar type `T`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation<T> {
    /// Real part.
    pub w: T,
    /// Imaginary part (i, j, k).
    pub v: Vector3<T>,
}

impl<T: Scalar> Rotation<T> {
    /// The rotation as a constant: its derivatives are zero.
    pub fn constant(rotation: &UnitQuaternion<f64>) -> Self {
        Self { w: T::from(rotation.w), v: rotation.imag().map(T::from) }
    }

    /// R x.
    #[inline(always)]
    pub fn rotate(&self, x: &Vector3<T>) -> Vector3<T> {
        let t = cross(&self.v, x);
        let t = Vector3::new(t[0] * 2.0, t[1] * 2.0, t[2] * 2.0);
        let u = cross(&self.v, &t);
        let w = self.w;
        Vector3::new(x[0] + w * t[0] + u[0], x[1] + w * t[1] + u[1], x[2] + w * t[2] + u[2])
    }

    /// R⁻¹.
    #[inline(always)]
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self { w: self.w, v: Vector3::new(-self.v[0], -self.v[1], -self.v[2]) }
    }

    /// R₁ R₂.
    #[inline(always)]
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        let w = self.w * other.w - dot(&self.v, &other.v);
        let c = cross(&self.v, &other.v);
        let component = |i: usize| other.v[i] * self.w + self.v[i] * other.w + c[i];
        Self { w, v: Vector3::new(component(0), component(1), component(2)) }
    }

    /// The rotation vector, in radians, of angle at most π: the inverse of Exp.
    pub fn log(&self) -> Vector3<T> {
        let (w, v) = if self.w.re() < 0.0 { (-self.w, self.v.map(|c| -c)) } else { (self.w, self.v) };
        let s = dot(&v, &v);
        let factor = if s.re() < 1e-12 {
            // 2 atan(n/w)/n by its series in n = √s, whose derivative exists at n = 0.
            (T::from(1.0) - s / (w * w * 3.0)) * 2.0 / w
        } else {
            let n = s.sqrt();
            n.atan2(w) * 2.0 / n
        };
        v.map(|c| c * factor)
    }

    /// The rotation matrix.
    pub fn matrix(&self) -> Matrix3<T> {
        let basis = |i: usize| Vector3::from_fn(|r, _| T::from(if r == i { 1.0 } else { 0.0 }));
        Matrix3::from_columns(&[self.rotate(&basis(0)), self.rotate(&basis(1)), self.rotate(&basis(2))])
    }
}

/// A rigid motion x ↦ R x + t over the scalar type `T`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<T> {
    /// R.
    pub rotation: Rotation<T>,
    /// t.
    pub translation: Vector3<T>,
}

impl<T: Scalar> Pose<T> {
    /// The motion as a constant: its derivatives are zero.
    pub fn constant(pose: &Isometry3<f64>) -> Self {
        Self { rotation: Rotation::constant(&pose.rotation), translation: pose.translation.vector.map(T::from) }
    }

    /// R x + t.
    #[inline(always)]
    pub fn transform(&self, x: &Vector3<T>) -> Vector3<T> {
        let (r, t) = (self.rotation.rotate(x), &self.translation);
        Vector3::new(r[0] + t[0], r[1] + t[1], r[2] + t[2])
    }

    /// x ↦ R⁻¹ (x − t).
    #[inline(always)]
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        let t = rotation.rotate(&self.translation);
        Self { rotation, translation: Vector3::new(-t[0], -t[1], -t[2]) }
    }

    /// x ↦ R₁ (R₂ x + t₂) + t₁.
    #[inline(always)]
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        Self { rotation: self.rotation.compose(&other.rotation), translation: self.transform(&other.translation) }
    }
}

#[inline(always)]
fn cross<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
}

#[inline(always)]
fn dot<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// q ⊗ (1, ω/2), which is q ⊗ Exp(ω) to first order in ω.
///
/// The exponential itself cannot be used: it contains √(ω·ω), whose derivative does not exist at ω = 0.
#[inline(always)]
fn retract_rotation<T: Scalar>(q: &UnitQuaternion<f64>, omega: [T; 3]) -> Rotation<T> {
    let (w, v) = (q.w, q.imag());
    let half = [omega[0] * 0.5, omega[1] * 0.5, omega[2] * 0.5];
    Rotation {
        w: -(half[0] * v[0] + half[1] * v[1] + half[2] * v[2]) + w,
        v: Vector3::new(
            half[0] * w + (half[2] * v[1] - half[1] * v[2]) + v[0],
            half[1] * w + (half[0] * v[2] - half[2] * v[0]) + v[1],
            half[2] * w + (half[1] * v[0] - half[0] * v[1]) + v[2],
        ),
    }
}

impl AutoDiffVariable for UnitQuaternion<f64> {
    const DIM: usize = 3;
    type Over<T: Scalar> = Rotation<T>;

    #[inline(always)]
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Rotation<T> {
        retract_rotation(self, [delta(0), delta(1), delta(2)])
    }
}

impl AutoDiffVariable for Isometry3<f64> {
    const DIM: usize = 6;
    type Over<T: Scalar> = Pose<T>;

    #[inline(always)]
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Pose<T> {
        let t = &self.translation.vector;
        Pose {
            rotation: retract_rotation(&self.rotation, [delta(0), delta(1), delta(2)]),
            translation: Vector3::new(delta(3) + t[0], delta(4) + t[1], delta(5) + t[2]),
        }
    }
}
