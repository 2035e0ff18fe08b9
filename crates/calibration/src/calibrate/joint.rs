//! Everything in one adjustment: markers and depth pixels, with the noise of both estimated on the way.

use depthcal_model::{Block, Camera, Modulation};

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::domain::seen;
use super::error::CalibrateError;
use super::folds::check_invertible;
use super::held::hold;
use super::large_fields::settle_by_node;
use super::rules::joint_rules;
use super::settle::{LEAST_INVERSE_DEPTH_SIGMA, settle};
use crate::adjust::field_cells;
use crate::adjust::smoothness_prior::{Smoothness, hold_untouched};
use crate::adjust::state::{CameraState, State};
use crate::observe::board_pixels::BoardPixel;
use crate::observe::depth_sampling::{plane_deviations, sample_depth};
use crate::observe::noise::{DepthNoise, NoiseModel, fit_depth_noise};
use crate::observe::{CameraFrames, PosedFrame, SampledFrame};

/// Samples the depth of frames with a pose, with the light of their frames where `light` has the frequencies; also returns the
/// correlation length of the noise, px.
pub(super) fn sample(
    capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    light: Option<Modulation>,
    options: &CameraOptions,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), CalibrateError> {
    let _stage = options.progress.stage("sampling depth");
    let (capture, correlation) = sample_depth(capture, camera, options.samples_per_frame, light)?;
    if capture.frames.iter().all(|f| f.samples.is_empty()) {
        return Err(CalibrateError::NoDepthOnBoard { dataset: capture.name });
    }
    Ok((capture, correlation))
}

/// A camera that was fitted to the images with the depth pieces at their nominal values, and the noise of depth as deviations
/// from planes show it: the start of a joint adjustment.
pub(super) fn with_depth_pieces(
    capture: &CameraFrames<SampledFrame>,
    mut camera: Camera,
    noise: NoiseModel,
    depth_blocks: Vec<Block>,
) -> (Camera, NoiseModel) {
    let domain = seen(capture);
    for block in depth_blocks {
        camera = camera.with_block(block.over(&domain));
    }
    (camera, NoiseModel { depth: depth_noise_from_planes(capture), ..noise })
}

/// Adds the depth pieces to a camera that was fitted to the images, with the noise of its markers, and adjusts everything
/// jointly.
pub(super) fn joint(
    capture: CameraFrames<SampledFrame>,
    correlation_length_px: Option<usize>,
    camera: Camera,
    noise: NoiseModel,
    depth_blocks: Vec<Block>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let (camera, noise) = with_depth_pieces(&capture, camera, noise, depth_blocks);
    let result = adjust_samples(capture, camera, noise, None, options)?;
    Ok(CalibratedCamera { correlation_length_px, ..result })
}

/// Adjusts a camera with depth pieces to sampled frames. Where `earlier` is given, the search for the roughness of fields starts
/// from the values of this fit.
pub(super) fn adjust_samples(
    capture: CameraFrames<SampledFrame>,
    camera: Camera,
    noise: NoiseModel,
    earlier: Option<&Smoothness>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let _stage = options.progress.stage("joint adjustment");
    // The pinhole has its value from the images already.
    let camera = hold(&hold_untouched(&camera, &capture), &options.held, true);
    let coarse = field_cells::coarse(&camera, &options.register, &seen(&capture))?;
    let mut smoothness = Smoothness::of(&camera, &options.field_thresholds);
    if let Some(earlier) = earlier {
        smoothness.start_from(earlier);
    }
    let start =
        CameraState { smoothness, prior: options.prior.clone(), ..CameraState::reference(capture, camera, noise) };
    let result = match coarse {
        None => settle(State::of_camera(start), &joint_rules(), options)?.only_camera(options),
        Some((coarse, factors)) => settle_by_node(start, &coarse, &factors, options)?,
    };
    check_invertible(&result)?;
    Ok(result)
}

/// Depth noise to start with: deviations from a plane of each frame's own.
fn depth_noise_from_planes(capture: &CameraFrames<SampledFrame>) -> DepthNoise {
    let mut samples = Vec::new();
    for frame in &capture.frames {
        let pixels: Vec<_> = frame
            .samples
            .iter()
            .map(|s| BoardPixel {
                number: 0,
                pixel: s.context.pixel,
                depth_mm: s.depth_mm,
                board_depth_mm: s.depth_mm,
                board: s.board_seed,
                // Pixels instead of rays: a plane is affine in either, up to the lens.
                ray: [s.context.pixel[0] / 1000.0, s.context.pixel[1] / 1000.0],
                cos_incidence: 1.0,
            })
            .collect();
        let deviations = plane_deviations(&pixels);
        samples.extend(pixels.iter().zip(deviations).map(|(p, d)| (1.0 / p.depth_mm, d)));
    }
    let law = fit_depth_noise(&samples, 1.0).unwrap_or(DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 });
    DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law }
}
