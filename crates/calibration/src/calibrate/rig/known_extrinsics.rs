//! Known extrinsics of a camera, instead of those that views of the board show.

use nalgebra::Isometry3;
use tracing::warn;

use crate::observe::CameraCapture;

/// Largest difference of known extrinsics from those of the views, of which nothing is said: rotation, rad, and translation as a
/// share of its length, at least that of 100 mm.
const MOST_OFF: [f64; 2] = [0.02, 0.1];

/// Takes the known extrinsics of a camera, where it has any, instead of those of its views.
pub(super) fn take_known(of_views: &mut Isometry3<f64>, camera: &CameraCapture) {
    let Some(known) = camera.camera_from_rig else { return };
    let turn = known.rotation.angle_to(&of_views.rotation);
    let shift_mm = (known.translation.vector - of_views.translation.vector).norm();
    if turn > MOST_OFF[0] || shift_mm > MOST_OFF[1] * known.translation.vector.norm().max(100.0) {
        warn!(
            "{}: the declared camera_from_rig is {shift_mm:.0} mm and {:.1}° from what the views of the board show: check it",
            camera.name,
            turn.to_degrees()
        );
    }
    *of_views = known;
}
