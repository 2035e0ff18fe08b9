//! Everything in one adjustment: markers and depth pixels, with the noise of both estimated on the way.

use depthcal_model::Block;

use super::domain::seen;
use super::error::CalibrateError;
use super::fitted::Calibrated;
use super::folds::check_invertible;
use super::held::hold;
use super::large_fields::settle_by_node;
use super::options::CalibrateOptions;
use super::settle::{LEAST_INVERSE_DEPTH_SIGMA, State, joint_rules, settle};
use crate::adjust::field_cells;
use crate::adjust::smoothness_prior::{Smoothness, hold_untouched};
use crate::observe::board_region::BoardPixel;
use crate::observe::depth_sampling::{plane_deviations, sample_depth};
use crate::observe::noise::{DepthNoise, NoiseModel};
use crate::observe::{Capture, PosedFrame, SampledFrame};

/// Adds the depth pieces to a camera that was fitted to the images, and adjusts everything jointly.
pub(super) fn joint(
    from_image: Calibrated<PosedFrame>,
    depth_blocks: Vec<Block>,
    options: &CalibrateOptions,
) -> Result<Calibrated, CalibrateError> {
    let lens_choice = from_image.lens_choice;
    let (capture, correlation) = sample_depth(from_image.capture, &from_image.camera, options.samples_per_frame);
    if capture.frames.iter().all(|f| f.samples.is_empty()) {
        return Err(CalibrateError::NoDepthOnBoard { dataset: capture.name });
    }
    let domain = seen(&capture);
    let mut camera = from_image.camera;
    for block in depth_blocks {
        camera = camera.with_block(block.over(&domain));
    }
    // The pinhole has its value from the images already.
    camera = hold(&hold_untouched(&camera, &capture), &options.held, true);
    let coarse = field_cells::coarse(&camera, &options.register, &domain)?;
    let noise = NoiseModel { depth: depth_noise_from_planes(&capture), ..from_image.noise };
    let start = State { smoothness: Smoothness::of(&camera, &options.field_thresholds), capture, camera, noise };
    let mut result = match coarse {
        None => settle(start, &joint_rules(), options)?,
        Some((coarse, factors)) => settle_by_node(start, &coarse, &factors, options)?,
    };
    result.correlation_length_px = correlation;
    result.lens_choice = lens_choice;
    check_invertible(&result)?;
    Ok(result)
}

/// Depth noise to start with: deviations from a plane of each frame's own.
fn depth_noise_from_planes(capture: &Capture<SampledFrame>) -> DepthNoise {
    let mut samples = Vec::new();
    for frame in &capture.frames {
        let pixels: Vec<_> = frame
            .samples
            .iter()
            .map(|s| BoardPixel {
                context: s.context,
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
    let law = DepthNoise::fit(&samples, 1.0).unwrap_or(DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 });
    DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law }
}
