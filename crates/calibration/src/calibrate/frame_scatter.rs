//! Standard deviations that cover what changes from frame to frame, for fits that were made without.

use super::calibrated_camera::CalibratedCamera;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::plane_scatter::{covariance_with_planes, plane_scatter};
use crate::adjust::state::{CameraState, State};
use crate::observe::noise::{NoiseModel, PlaneScatter};

/// A fit of which the covariance covers the scatter of the frames' own planes and of their terms in the inverse amplitude; its
/// parameters stay. The same fit where noise explains them, and of models with fields, which take up a part of them.
pub fn with_frame_scatter(fit: CalibratedCamera) -> CalibratedCamera {
    let Some(covariance) = fit.covariance.as_ref().filter(|_| fit.with_depth && fit.smoothness.fields.is_empty())
    else {
        return fit;
    };
    let state = State::of_camera(CameraState::reference(fit.capture.clone(), fit.camera.clone(), fit.noise));
    let scatter = plane_scatter(&state, 0, &[fit.noise]);
    if scatter == PlaneScatter::NONE {
        return fit;
    }
    let noise = NoiseModel { planes: PlaneScatter::NONE, ..fit.noise };
    let adjustment = Adjustment::new(&fit.capture, &fit.camera, &noise, true);
    let covariance = covariance_with_planes(&adjustment, (&state, 0), &noise.depth, &scatter, covariance);
    let noise = NoiseModel { planes: PlaneScatter { design_effect: 1.0, ..scatter }, ..noise };
    CalibratedCamera { covariance: Some(covariance), noise, ..fit }
}
