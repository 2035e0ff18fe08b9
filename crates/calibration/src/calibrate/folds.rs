//! A fitted depth model must have one inverse wherever it was fitted.

use depthcal_model::CameraError;

use super::calibrated_camera::CalibratedCamera;
use super::domain::seen;

/// Depths on every ray at which folds are looked for.
const FOLD_STEPS: usize = 60;

/// The fitted camera must be invertible at every sample that it was fitted to, and must not fold between the nearest and
/// the farthest depth that was seen at any of their pixels: a fold between two samples gives one of two depths.
///
/// # Errors
///
/// [`CameraError`] where it folds.
pub fn check_invertible(result: &CalibratedCamera) -> Result<(), CameraError> {
    let range = seen(&result.capture).depth_mm;
    for frame in &result.capture.frames {
        for sample in frame.samples.iter().step_by(10) {
            result.camera.correct(&sample.context, 1.0, 1.0 / sample.depth_mm)?;
        }
        if let Some(range) = range {
            for sample in frame.samples.iter().step_by(40) {
                result.camera.check_depth_folds(&sample.context, range, FOLD_STEPS)?;
            }
        }
    }
    Ok(())
}
