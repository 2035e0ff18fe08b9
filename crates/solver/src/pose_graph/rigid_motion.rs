//! Rigid motions in the plane and in space, with rotations as matrices.

use nalgebra::{
    Isometry3, Matrix2, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector2, Vector3,
};

/// A rigid motion x ↦ R x + t of the plane (D = 2) or of space (D = 3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion<const D: usize> {
    /// R, an orthogonal matrix of determinant 1.
    pub rotation: SMatrix<f64, D, D>,
    /// t, in the unit of the measurements.
    pub translation: SVector<f64, D>,
}

impl<const D: usize> RigidMotion<D> {
    /// The motion that moves nothing.
    pub fn identity() -> Self {
        Self { rotation: SMatrix::identity(), translation: SVector::zeros() }
    }

    /// x ↦ Rᵀ (x − t).
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// x ↦ R₁ (R₂ x + t₂) + t₁.
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        let translation = self.rotation * other.translation + self.translation;
        Self { rotation: self.rotation * other.rotation, translation }
    }
}

/// From (x, y, angle in rad).
impl From<Vector3<f64>> for RigidMotion<2> {
    fn from(pose: Vector3<f64>) -> Self {
        let (s, c) = pose.z.sin_cos();
        Self { rotation: Matrix2::new(c, -s, s, c), translation: Vector2::new(pose.x, pose.y) }
    }
}

/// As (x, y, angle in rad), with an angle from −π to π.
impl From<RigidMotion<2>> for Vector3<f64> {
    fn from(motion: RigidMotion<2>) -> Self {
        let angle = motion.rotation[(1, 0)].atan2(motion.rotation[(0, 0)]);
        Vector3::new(motion.translation.x, motion.translation.y, angle)
    }
}

impl From<Isometry3<f64>> for RigidMotion<3> {
    fn from(pose: Isometry3<f64>) -> Self {
        Self { rotation: *pose.rotation.to_rotation_matrix().matrix(), translation: pose.translation.vector }
    }
}

impl From<RigidMotion<3>> for Isometry3<f64> {
    fn from(motion: RigidMotion<3>) -> Self {
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(motion.rotation));
        Isometry3::from_parts(Translation3::from(motion.translation), rotation)
    }
}

/// The rotation that is closest to a matrix in the Frobenius norm: U diag(1, …, det U Vᵀ) Vᵀ of its singular value
/// decomposition U S Vᵀ (Umeyama 1991). `None` if the matrix is not finite.
pub(super) fn nearest_rotation<const D: usize>(matrix: &SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut large = Matrix3::identity();
    large.view_mut((0, 0), (D, D)).copy_from(matrix);
    // A plane's matrix is completed by an axis longer than its own ones, which keeps its place.
    let scale = matrix.amax();
    (D..3).for_each(|i| large[(i, i)] = 10.0 * scale.max(f64::MIN_POSITIVE));
    let svd = large.svd(true, true);
    let (mut u, v_t) = (svd.u?, svd.v_t?);
    if (u * v_t).determinant() < 0.0 {
        let least = svd.singular_values.imin();
        u.column_mut(least).neg_mut();
    }
    Some((u * v_t).fixed_view::<D, D>(0, 0).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_rotation_is_the_polar_factor() {
        for angle in [-3.0, -1.0, 0.2, 2.9_f64] {
            let plane = RigidMotion::from(Vector3::new(0.0, 0.0, angle)).rotation;
            let stretched = plane * Matrix2::new(3.0, 0.4, 0.4, 0.2);
            assert!((nearest_rotation(&stretched).unwrap() - plane).amax() < 1e-12);
            let turned = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.5, 1.0) * angle);
            let space = *turned.to_rotation_matrix().matrix();
            let stretched = space * Matrix3::new(2.0, 0.1, 0.3, 0.1, 1.0, -0.2, 0.3, -0.2, 0.5);
            assert!((nearest_rotation(&stretched).unwrap() - space).amax() < 1e-12);
        }
        // Of all rotations, a reflection is closest to the one that turns its weakest axis.
        let mirrored = Matrix3::from_diagonal(&Vector3::new(2.0, 3.0, -1.0));
        assert!((nearest_rotation(&mirrored).unwrap() - Matrix3::identity()).amax() < 1e-12);
        assert_eq!(nearest_rotation(&Matrix2::new(1.0, 0.0, f64::NAN, 1.0)), None);
    }

    #[test]
    fn conversions_return_the_pose() {
        let plane = Vector3::new(1.0, -2.0, -2.5);
        assert!((Vector3::from(RigidMotion::from(plane)) - plane).amax() < 1e-15);
        let space = Isometry3::new(Vector3::new(1.0, 2.0, -3.0), Vector3::new(2.0, -1.0, 0.5));
        assert!((Isometry3::from(RigidMotion::from(space)).inverse() * space).rotation.angle() < 1e-12);
    }
}
