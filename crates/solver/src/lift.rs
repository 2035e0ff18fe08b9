//! Variables lifted to dual numbers, so that factors can be differentiated.

use nalgebra::{Isometry3, Matrix3, SVector, Unit, UnitQuaternion, Vector3};
use num_dual::DualNum;

use crate::manifold::tangent_basis;
use crate::variable::Variable;

/// A real number or a dual number: what a factor's residual is generic over.
pub trait Scalar: DualNum<Primitive = f64> + Copy + Send + Sync {}

impl<T: DualNum<Primitive = f64> + Copy + Send + Sync> Scalar for T {}

/// A variable of static dimension that factors with automatic derivatives may use.
pub trait Lift: Variable {
    /// Tangent dimension.
    const DIM: usize;

    /// The variable over the scalar `T`.
    type Lifted<T: Scalar>;

    /// `self.retract(δ)` over `T`, where `delta(i)` is δᵢ. Only its value and first derivatives at δ = 0 are asked for, so
    /// a form of first order in δ is enough.
    fn lift<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Self::Lifted<T>;
}

impl<const N: usize> Lift for SVector<f64, N> {
    const DIM: usize = N;
    type Lifted<T: Scalar> = SVector<T, N>;

    #[inline(always)]
    fn lift<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> SVector<T, N> {
        SVector::from_fn(|i, _| delta(i) + self[i])
    }
}

/// A rotation by a unit quaternion over the scalar `T`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation<T> {
    /// Real part.
    pub w: T,
    /// Imaginary part (i, j, k).
    pub v: Vector3<T>,
}

impl<T: Scalar> Rotation<T> {
    /// The rotation without derivatives.
    pub fn constant(rotation: &UnitQuaternion<f64>) -> Self {
        Self { w: T::from(rotation.w), v: rotation.imag().map(T::from) }
    }

    /// R x.
    #[inline(always)]
    pub fn rotate(&self, x: &Vector3<T>) -> Vector3<T> {
        let t = cross(&self.v, x).map(|c| c * 2.0);
        let u = cross(&self.v, &t);
        Vector3::from_fn(|i, _| x[i] + self.w * t[i] + u[i])
    }

    /// R⁻¹.
    #[inline(always)]
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self { w: self.w, v: self.v.map(|c| -c) }
    }

    /// R₁ R₂.
    #[inline(always)]
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        let w = self.w * other.w - dot(&self.v, &other.v);
        let c = cross(&self.v, &other.v);
        Self { w, v: Vector3::from_fn(|i, _| other.v[i] * self.w + self.v[i] * other.w + c[i]) }
    }

    /// The rotation vector of angle at most π, in radians: the inverse of Exp.
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

/// A rigid motion x ↦ R x + t over the scalar `T`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<T> {
    /// R.
    pub rotation: Rotation<T>,
    /// t.
    pub translation: Vector3<T>,
}

impl<T: Scalar> Pose<T> {
    /// The motion without derivatives.
    pub fn constant(pose: &Isometry3<f64>) -> Self {
        Self { rotation: Rotation::constant(&pose.rotation), translation: pose.translation.vector.map(T::from) }
    }

    /// R x + t.
    #[inline(always)]
    pub fn transform(&self, x: &Vector3<T>) -> Vector3<T> {
        let r = self.rotation.rotate(x);
        Vector3::from_fn(|i, _| r[i] + self.translation[i])
    }

    /// x ↦ R⁻¹ (x − t).
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: rotation.rotate(&self.translation).map(|c| -c) }
    }

    /// x ↦ R₁ (R₂ x + t₂) + t₁.
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

/// q ⊗ (1, ω/2): of unit length but for terms of second order in ω.
///
/// The exponential itself must not be used: under dual numbers its square roots lose the derivative at ω = 0.
#[inline(always)]
fn lift_rotation<T: Scalar>(q: &UnitQuaternion<f64>, omega: Vector3<T>) -> Rotation<T> {
    let (w, v) = (q.w, q.imag());
    let half = omega.map(|c| c * 0.5);
    Rotation {
        w: -(half[0] * v[0] + half[1] * v[1] + half[2] * v[2]) + w,
        v: Vector3::new(
            half[0] * w + (half[2] * v[1] - half[1] * v[2]) + v[0],
            half[1] * w + (half[0] * v[2] - half[2] * v[0]) + v[1],
            half[2] * w + (half[1] * v[0] - half[0] * v[1]) + v[2],
        ),
    }
}

impl Lift for UnitQuaternion<f64> {
    const DIM: usize = 3;
    type Lifted<T: Scalar> = Rotation<T>;

    #[inline(always)]
    fn lift<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Rotation<T> {
        lift_rotation(self, Vector3::from_fn(|i, _| delta(i)))
    }
}

impl Lift for Isometry3<f64> {
    const DIM: usize = 6;
    type Lifted<T: Scalar> = Pose<T>;

    #[inline(always)]
    fn lift<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Pose<T> {
        Pose {
            rotation: lift_rotation(&self.rotation, Vector3::from_fn(|i, _| delta(i))),
            translation: Vector3::from_fn(|i, _| delta(i + 3) + self.translation.vector[i]),
        }
    }
}

impl Lift for Unit<Vector3<f64>> {
    const DIM: usize = 2;
    type Lifted<T: Scalar> = Vector3<T>;

    #[inline(always)]
    fn lift<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Vector3<T> {
        let [b0, b1] = tangent_basis(self);
        Vector3::from_fn(|i, _| delta(0) * b0[i] + delta(1) * b1[i] + self[i])
    }
}
