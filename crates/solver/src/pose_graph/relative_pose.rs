//! Measured relative poses, with the two precisions of SE-Sync, and its objective.

use nalgebra::{Isometry3, Matrix2, Matrix3, Vector3};

use crate::pose_graph::error::PoseGraphError;
use crate::pose_graph::rigid_motion::RigidMotion;

/// A measured relative pose: the pose of `to` in the frame of `from`, with isotropic precisions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativePose<const D: usize> {
    /// Index of the pose whose frame it is.
    pub from: usize,
    /// Index of the pose that is seen.
    pub to: usize,
    /// R_ij and t_ij.
    pub motion: RigidMotion<D>,
    /// κ_ij, the concentration of the rotation's Langevin distribution.
    pub kappa: f64,
    /// τ_ij, the precision of the translation, 1/length².
    pub tau: f64,
}

impl RelativePose<2> {
    /// From a measured (x, y, angle in rad) and its information (inverse covariance), as in a file of g2o: τ = 2 / tr Ω_t⁻¹
    /// with Ω_t the information of x, y, and κ the information of the angle, as SE-Sync takes them.
    ///
    /// # Errors
    /// [`PoseGraphError::Singular`] if either is not positive.
    pub fn in_plane(
        from: usize,
        to: usize,
        measurement: [f64; 3],
        information: &[[f64; 3]; 3],
    ) -> Result<Self, PoseGraphError> {
        let translation = Matrix2::from_fn(|i, j| information[i][j]);
        let tau = precision(from, to, "translation", 2.0, translation.try_inverse().map(|m| m.trace()))?;
        let kappa = precision(from, to, "rotation", 1.0, Some(1.0 / information[2][2]))?;
        Ok(Self { from, to, motion: Vector3::from(measurement).into(), kappa, tau })
    }
}

impl RelativePose<3> {
    /// From a measured motion and the information of (translation, rotation), as in a file of g2o: τ = 3 / tr Ω_t⁻¹ and
    /// κ = 3 / (2 tr Ω_R⁻¹) with Ω_t and Ω_R the diagonal blocks, as SE-Sync takes them.
    ///
    /// # Errors
    /// [`PoseGraphError::Singular`] if either is not positive.
    pub fn in_space(
        from: usize,
        to: usize,
        measurement: &Isometry3<f64>,
        information: &[[f64; 6]; 6],
    ) -> Result<Self, PoseGraphError> {
        let trace = |first: usize| {
            Matrix3::from_fn(|i, j| information[first + i][first + j]).try_inverse().map(|inverse| inverse.trace())
        };
        let tau = precision(from, to, "translation", 3.0, trace(0))?;
        let kappa = precision(from, to, "rotation", 1.5, trace(3))?;
        Ok(Self { from, to, motion: (*measurement).into(), kappa, tau })
    }
}

/// `numerator` / `trace`, if that is a positive number.
fn precision(
    from: usize,
    to: usize,
    part: &'static str,
    numerator: f64,
    trace: Option<f64>,
) -> Result<f64, PoseGraphError> {
    let value = trace.map(|trace| numerator / trace).filter(|p| p.is_finite() && *p > 0.0);
    value.ok_or(PoseGraphError::Singular { from, to, part })
}

impl<const D: usize> RelativePose<D> {
    /// κ ‖R_j − R_i R_ij‖² + τ ‖t_j − t_i − R_i t_ij‖² for the poses i and j of its ends, with Frobenius norms.
    pub fn chordal_error(&self, from: &RigidMotion<D>, to: &RigidMotion<D>) -> f64 {
        let rotation = to.rotation - from.rotation * self.motion.rotation;
        let translation = to.translation - from.translation - from.rotation * self.motion.translation;
        self.kappa * rotation.norm_squared() + self.tau * translation.norm_squared()
    }
}

/// SE-Sync's objective, Σ κ_ij ‖R_j − R_i R_ij‖² + τ_ij ‖t_j − t_i − R_i t_ij‖² (Rosen et al. 2019, problem 2).
///
/// It is twice the cost of [`ChordalPlane`](super::ChordalPlane) or [`ChordalSpace`](super::ChordalSpace).
///
/// # Errors
/// [`PoseGraphError::Ends`].
pub fn chordal_objective<const D: usize>(
    poses: &[RigidMotion<D>],
    measurements: &[RelativePose<D>],
) -> Result<f64, PoseGraphError> {
    check_ends(poses.len(), measurements)?;
    Ok(measurements.iter().map(|m| m.chordal_error(&poses[m.from], &poses[m.to])).sum())
}

/// Checks that the ends of all measurements are two of `count` poses.
pub(super) fn check_ends<const D: usize>(count: usize, measurements: &[RelativePose<D>]) -> Result<(), PoseGraphError> {
    match measurements.iter().find(|m| m.from >= count || m.to >= count || m.from == m.to) {
        Some(m) => Err(PoseGraphError::Ends { from: m.from, to: m.to, count }),
        None => Ok(()),
    }
}
