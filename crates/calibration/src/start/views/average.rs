//! Averages of rigid motions.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// The mean of rigid motions: of their quaternions with signs aligned, which is the chordal mean for near rotations (Hartley,
/// Trumpf, Dai, Li 2013), and of their translations. `None` without any.
pub(crate) fn mean(poses: &[Isometry3<f64>]) -> Option<Isometry3<f64>> {
    let first = poses.first()?;
    let n = poses.len() as f64;
    let mut rotation = Quaternion::new(0.0, 0.0, 0.0, 0.0);
    let mut translation = Vector3::zeros();
    for pose in poses {
        let q = *pose.rotation.quaternion();
        rotation += if q.dot(first.rotation.quaternion()) < 0.0 { -q } else { q };
        translation += pose.translation.vector / n;
    }
    Some(Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::try_new(rotation, 1e-6)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_turns_about_one_axis() {
        let turn = |a: f64| Isometry3::new(Vector3::new(a, 0.0, 0.0), Vector3::z() * a);
        let average = mean(&[turn(0.1), turn(0.3)]).unwrap();
        assert!((average.rotation.angle_to(&turn(0.2).rotation)) < 1e-12);
        assert!((average.translation.vector.x - 0.2).abs() < 1e-12);
        assert!(mean(&[]).is_none());
    }
}
