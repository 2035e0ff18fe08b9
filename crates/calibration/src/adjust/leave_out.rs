//! Cameras as they would be without a part of the frames, from the adjustment of all frames.
//!
//! At the optimum of all frames the cost of the others is quadratic in the parameters to the extent that taking a part out moves
//! them: by less than a standard deviation or so. One Gauss–Newton step from the normal equations of the frames, each with its
//! pose eliminated, is then the estimate without the part (Pregibon 1981, one-step approximation), and costs no adjustment.

use depthcal_model::Camera;

use super::adjustment::Adjustment;
use super::camera_prior::CameraPrior;
use super::frame_information::Curvature;
use super::smoothness_prior::Smoothness;
use super::smoothness_selection::{FrameInformation, prior, solve_scaled};
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, CameraFrames};

/// Decrease of the cost below which an adjustment ends: what is left is a small part of a standard deviation.
pub(crate) const DECREASE: f64 = 1e-4;
/// Most free parameters of a camera: matrices of this size are dense.
const MOST_PARAMETERS: usize = 800;

/// The cameras without each of `parts` parts, given the part of every frame, at the optimum `camera` of all frames with the prior
/// `smoothness` of its fields, and `of_camera` of its parameters where there is one; `None` where the other frames do not
/// determine the parameters, or where these are too many.
pub fn cameras_without_parts<F: AdjustableFrame>(
    capture: &CameraFrames<F>,
    camera: &Camera,
    noise: &NoiseModel,
    (smoothness, of_camera): (&Smoothness, Option<&CameraPrior>),
    part_of: &[usize],
    parts: usize,
) -> Vec<Option<Camera>> {
    let adjustment = Adjustment::new(capture, camera, noise, true);
    if adjustment.by_node() || camera.theta().len() > MOST_PARAMETERS {
        return vec![None; parts];
    }
    let frames = adjustment.frame_information(Curvature::OfLoss);
    let (mut precision, mut pull) = prior(camera, smoothness, &frames);
    if let Some((more, further)) = of_camera.and_then(|p| p.of(camera)).map(|p| p.normal(camera)) {
        precision += more;
        pull += further;
    }
    let free = camera.free_parameters();
    let without = |part: usize| {
        let other_frames = frames.iter().zip(part_of).filter(|(_, of)| **of != part).map(|(frame, _)| frame);
        let (normal, gradient) = FrameInformation::added((precision.clone(), pull.clone()), other_frames);
        let step = solve_scaled(normal, &-gradient)?;
        let mut theta = camera.theta();
        for (i, step) in free.iter().zip(step.iter()) {
            theta[*i] += step;
        }
        Some(camera.with_theta(&theta))
    };
    (0..parts).map(without).collect()
}

/// The camera that frames alone determine, with the noise and the smoothness of the adjustment of all frames, from whose `camera`
/// and poses it starts; `None` where the adjustment fails.
pub fn camera_of_frames<F: AdjustableFrame>(
    capture: &CameraFrames<F>,
    camera: &Camera,
    noise: &NoiseModel,
    (smoothness, of_camera): (&Smoothness, Option<&CameraPrior>),
) -> Option<Camera> {
    let mut adjustment =
        Adjustment::new(capture, camera, noise, true).with_smoothness(smoothness).with_prior(of_camera);
    let adjusted = adjustment.refine_within(DECREASE).ok()?;
    let is_converged = adjusted.report.converged;
    adjusted.cameras.into_iter().next().filter(|_| is_converged).map(|adjusted| adjusted.camera)
}
