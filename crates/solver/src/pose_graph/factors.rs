//! Factors of relative poses: g2o's error and SE-Sync's, in the plane and in space.

use std::f64::consts::{SQRT_2, TAU};

use nalgebra::{DMatrix, Isometry3, SMatrix, SVector, SymmetricEigen, Vector3};

use crate::pose_graph::relative_pose::RelativePose;
use crate::problem::autodiff::Scalar;
use crate::problem::factor::{Factor, Over};
use crate::problem::rigid_motion::Pose;

/// A measured relative pose in the plane, with the error of g2o: the difference of (x, y, angle).
///
/// The variables are poses (x, y, angle in rad).
#[derive(Clone, Debug)]
pub struct BetweenPlane {
    measurement: [f64; 3],
    /// A with Aᵀ A the information.
    root: SMatrix<f64, 3, 3>,
}

impl BetweenPlane {
    /// A factor of a measured (x, y, angle in rad) with its information, the inverse covariance, which may be singular.
    pub fn new(measurement: [f64; 3], information: &[[f64; 3]; 3]) -> Self {
        Self { measurement, root: square_root(information) }
    }
}

impl Factor<3> for BetweenPlane {
    type Variables = (Vector3<f64>, Vector3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 3> {
        weigh(&self.root, &difference(&self.measurement, &a, &b))
    }
}

/// A measured relative pose in space, with the error of g2o: translation and vector part of the quaternion (half the
/// rotation vector for small angles) of measured⁻¹ · predicted.
#[derive(Clone, Debug)]
pub struct BetweenSpace {
    /// The inverse of the measurement.
    inverse: Isometry3<f64>,
    root: SMatrix<f64, 6, 6>,
}

impl BetweenSpace {
    /// A factor of a measured motion with the information of (translation, quaternion's vector part), which may be singular.
    pub fn new(measurement: &Isometry3<f64>, information: &[[f64; 6]; 6]) -> Self {
        Self { inverse: measurement.inverse(), root: square_root(information) }
    }
}

impl Factor<6> for BetweenSpace {
    type Variables = (Isometry3<f64>, Isometry3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 6> {
        let [x, y, z, i, j, k] = remainder(&self.inverse, &a, &b);
        weigh(&self.root, &[x, y, z, i, j, k])
    }
}

/// A measured relative pose in the plane, with SE-Sync's error: ‖r‖² = κ ‖R_j − R_i R_ij‖² + τ ‖t_j − t_i − R_i t_ij‖².
///
/// With θ the angle of R_ijᵀ R_iᵀ R_j, ‖R_j − R_i R_ij‖ = 2 √2 |sin(θ/2)|: three residuals instead of six.
#[derive(Clone, Debug)]
pub struct ChordalPlane {
    measurement: [f64; 3],
    /// √τ and 2 √(2 κ).
    weights: [f64; 2],
}

impl ChordalPlane {
    /// A factor of a measured relative pose.
    pub fn new(measured: &RelativePose<2>) -> Self {
        let measurement = Vector3::from(measured.motion).into();
        Self { measurement, weights: [measured.tau.sqrt(), 2.0 * SQRT_2 * measured.kappa.sqrt()] }
    }
}

impl Factor<3> for ChordalPlane {
    type Variables = (Vector3<f64>, Vector3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 3> {
        let [x, y, angle] = difference(&self.measurement, &a, &b);
        let [wt, wr] = self.weights;
        SVector::<T, 3>::new(x * wt, y * wt, (angle * 0.5).sin() * wr)
    }
}

/// A measured relative pose in space, with SE-Sync's error: ‖r‖² = κ ‖R_j − R_i R_ij‖² + τ ‖t_j − t_i − R_i t_ij‖².
///
/// With v the vector part of the quaternion of R_ijᵀ R_iᵀ R_j, ‖R_j − R_i R_ij‖ = 2 √2 ‖v‖: six residuals instead of twelve, and
/// steps that see half of the curvature that the larger residuals neglect.
#[derive(Clone, Debug)]
pub struct ChordalSpace {
    inverse: Isometry3<f64>,
    /// √τ and 2 √(2 κ).
    weights: [f64; 2],
}

impl ChordalSpace {
    /// A factor of a measured relative pose.
    pub fn new(measured: &RelativePose<3>) -> Self {
        let inverse = Isometry3::from(measured.motion).inverse();
        Self { inverse, weights: [measured.tau.sqrt(), 2.0 * SQRT_2 * measured.kappa.sqrt()] }
    }
}

impl Factor<6> for ChordalSpace {
    type Variables = (Isometry3<f64>, Isometry3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 6> {
        let [x, y, z, i, j, k] = remainder(&self.inverse, &a, &b);
        let [wt, wr] = self.weights;
        SVector::<T, 6>::new(x * wt, y * wt, z * wt, i * wr, j * wr, k * wr)
    }
}

/// (x, y, angle) of b in the frame of a, minus the measured ones; the angle is from −π to π.
#[inline(always)]
fn difference<T: Scalar>([x, y, angle]: &[f64; 3], a: &Vector3<T>, b: &Vector3<T>) -> [T; 3] {
    let (s, c) = a[2].sin_cos();
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let turn = b[2] - a[2] - *angle;
    let turns = (turn.re() / TAU).round();
    [c * dx + s * dy - *x, c * dy - s * dx - *y, turn - turns * TAU]
}

/// Translation and vector part of the quaternion with positive real part of measured⁻¹ a⁻¹ b.
#[inline(always)]
fn remainder<T: Scalar>(inverse: &Isometry3<f64>, a: &Pose<T>, b: &Pose<T>) -> [T; 6] {
    let error = Pose::<T>::constant(inverse).compose(&a.inverse().compose(b));
    let sign = if error.rotation.w.re() < 0.0 { -1.0 } else { 1.0 };
    let (t, v) = (error.translation, error.rotation.v);
    [t[0], t[1], t[2], v[0] * sign, v[1] * sign, v[2] * sign]
}

/// A e for `root` = A.
#[inline(always)]
fn weigh<T: Scalar, const N: usize>(root: &SMatrix<f64, N, N>, e: &[T; N]) -> SVector<T, N> {
    let mut r = SVector::<T, N>::from_element(T::from(0.0));
    for i in 0..N {
        for j in 0..N {
            r[i] += e[j] * root[(i, j)];
        }
    }
    r
}

/// A with Aᵀ A = `information`, which may be singular.
fn square_root<const N: usize>(information: &[[f64; N]; N]) -> SMatrix<f64, N, N> {
    let eigen = SymmetricEigen::new(DMatrix::from_fn(N, N, |i, j| information[i][j]));
    SMatrix::from_fn(|i, j| eigen.eigenvalues[i].max(0.0).sqrt() * eigen.eigenvectors[(j, i)])
}
