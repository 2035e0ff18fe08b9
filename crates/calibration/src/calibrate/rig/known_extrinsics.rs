//! Known extrinsics of a camera, instead of those that views of the board show, and expected ones, against which a fit is held.

use nalgebra::Isometry3;
use tracing::warn;

use crate::calibrate::CameraFit;
use crate::observe::{CameraCapture, Capture};

/// Largest difference of known extrinsics from those of the views, of which nothing is said: rotation, rad, and translation as a
/// share of its length, at least that of 100 mm.
const MOST_OFF: [f64; 2] = [0.02, 0.1];

/// Takes the known extrinsics of a camera, where it has any, instead of those of its views.
pub(super) fn take_known(of_views: &mut Isometry3<f64>, camera: &CameraCapture) {
    let Some(known) = camera.camera_from_rig else { return };
    if let Some(apart) = apart(&known, of_views) {
        warn!(
            "{}: the declared camera_from_rig is {apart} from what the views of the board show: check it",
            camera.name
        );
    }
    *of_views = known;
}

/// Says where a fit contradicts the extrinsics that are expected.
pub(crate) fn compare_with_expected(capture: &Capture, fitted: &[CameraFit]) {
    for fit in fitted {
        let camera = capture.cameras.iter().find(|camera| camera.name == fit.name);
        let expected = camera.and_then(|camera| camera.expected_from_rig);
        if let Some(apart) = expected.and_then(|expected| apart(&expected, &fit.camera_from_rig)) {
            warn!(
                "{}: the fitted place is {apart} from expected_from_rig: check that frames are paired, that the boards determine the place \
                 (tilt and move them), and whose extrinsics were declared",
                fit.name
            );
        }
    }
}

/// How far places are apart, where that is more than the tolerance.
fn apart(declared: &Isometry3<f64>, place: &Isometry3<f64>) -> Option<String> {
    let turn = declared.rotation.angle_to(&place.rotation);
    let shift_mm = (declared.translation.vector - place.translation.vector).norm();
    let is_apart = turn > MOST_OFF[0] || shift_mm > MOST_OFF[1] * declared.translation.vector.norm().max(100.0);
    is_apart.then(|| format!("{shift_mm:.0} mm and {:.1}°", turn.to_degrees()))
}
