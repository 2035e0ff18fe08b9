//! Whether a step of a camera's parameters is small enough for a linear prediction of what it does.

use depthcal_model::Camera;

use crate::calibrate::CalibratedCamera;
use crate::observe::board_plane::BoardPlane;

/// Largest root mean square, in standard deviations of depth, of what the second order of a step adds to predicted depths: errors
/// on left-out frames are then right to half a per cent.
const MOST_SIGMAS: f64 = 0.1;
/// Depth samples per frame at which it is measured.
const SAMPLES_PER_FRAME: usize = 24;

/// Whether the depths that the model predicts are linear in the step from the fitted camera to `stepped`: half the second
/// difference along the step, at the fitted poses, is far below the noise. In directions that the data hardly determine steps are
/// long, and they are not.
pub(super) fn is_linear(fit: &CalibratedCamera, stepped: &Camera) -> bool {
    let (here, there) = (fit.camera.theta(), stepped.theta());
    let back: Vec<f64> = here.iter().zip(&there).map(|(here, there)| 2.0 * here - there).collect();
    let back = fit.camera.with_theta(&back);
    let (mut sum, mut count) = (0.0, 0.0);
    for frame in &fit.capture.frames {
        let plane = BoardPlane::new(&frame.camera_from_board);
        let step = frame.samples.len().div_ceil(SAMPLES_PER_FRAME).max(1);
        for sample in frame.samples.iter().step_by(step) {
            let Ok(ray) = fit.camera.ray(sample.context.pixel, 1.0 / sample.depth_mm) else { continue };
            let Some([.., rho, cosine]) = plane.depth_state(ray) else { continue };
            let [before, middle, after] =
                [&back, &fit.camera, stepped].map(|c| c.measured_inverse_depth(&sample.context, ray, cosine, rho));
            let second = 0.5 * (before + after - 2.0 * middle) / fit.noise.depth.sigma(rho);
            sum += second * second;
            count += 1.0;
        }
    }
    // Negated so that a depth without value counts as bent.
    !(sum > MOST_SIGMAS * MOST_SIGMAS * count) && sum.is_finite()
}
