//! Difference of the extrinsics of a camera in two calibrations of a rig.

use depthcal_io::{Calibration, CovarianceRecord, ExtrinsicsDifference};
use depthcal_statistics::chi_squared_tail;
use nalgebra::{Matrix6, Vector6};

use crate::observe::PlacedCamera;

/// Names of the six, after `CAMERA/camera_from_rig.`.
const NAMES: [&str; 6] = ["rx", "ry", "rz", "tx", "ty", "tz"];

/// Covariance of a camera's extrinsics; `None` where they are not estimated.
fn covariance(covariance: &CovarianceRecord, camera: &str) -> Option<Matrix6<f64>> {
    let name = |i: usize| format!("{camera}/camera_from_rig.{}", NAMES[i]);
    covariance.get(&name(0), &name(0))?;
    Some(Matrix6::from_fn(|i, j| covariance.get(&name(i), &name(j)).unwrap_or(0.0)))
}

/// Second minus first, with both covariances, of which the known ones count.
pub(super) fn extrinsics_difference(
    [first, second]: [&PlacedCamera; 2],
    calibrations: [Option<&Calibration>; 2],
) -> ExtrinsicsDifference {
    let rotation = (first.camera_from_rig.rotation.inverse() * second.camera_from_rig.rotation).scaled_axis();
    let translation = second.camera_from_rig.translation.vector - first.camera_from_rig.translation.vector;
    let of_side = |(calibration, camera): (Option<&Calibration>, &PlacedCamera)| {
        calibration.and_then(|c| covariance(c.covariance.as_ref()?, &camera.name))
    };
    let sides: Vec<Matrix6<f64>> = calibrations.into_iter().zip([first, second]).filter_map(of_side).collect();
    let sum: Matrix6<f64> = sides.iter().sum();
    let difference = Vector6::new(rotation.x, rotation.y, rotation.z, translation.x, translation.y, translation.z);
    let distance = sum.cholesky().map(|factor| difference.dot(&factor.solve(&difference)));
    ExtrinsicsDifference {
        rotation_rad: rotation.into(),
        translation_mm: translation.into(),
        std_dev: (!sides.is_empty()).then(|| std::array::from_fn(|i| sum[(i, i)].sqrt())),
        p_value: distance.map(|squared| chi_squared_tail(squared, 6)),
    }
}
