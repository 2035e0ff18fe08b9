//! Camera, lens and poses from the markers alone.

use depthcal_model::Block;

use super::error::CalibrateError;
use super::fitted::Calibrated;
use super::frame_checks::{markers_of, posed, repair, with_homographies};
use super::held::{check, hold};
use super::lens_choice::settle_with_chosen_lens;
use super::lens_comparison::{AUTO, fit_best_lens};
use super::lens_order::{BROWN_CONRADY, LensOrder, requested};
use super::options::CalibrateOptions;
use super::settle::{Freedom, ROUNDS, Rules, State, settle};
use crate::adjust::blocks::is_depth_only;
use crate::adjust::smoothness_prior::Smoothness;
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter};
use crate::observe::{Capture, PosedFrame};
use crate::start::{FEWEST_FRAMES, FrameMarkers, StartError, start_camera};

/// Adjusts camera, lens and poses to the markers alone, from start values that are found here.
///
/// Frames whose markers do not determine a pose, and misdetected boards, are dropped with the reason. Where the markers do not
/// determine the lens over the whole image, its order is chosen on left-out frames, unless the options ask for an order or
/// give a camera. With the lens `auto` the lens model itself is chosen on left-out frames.
///
/// # Errors
///
/// [`CalibrateError`], where the captures do not determine the camera.
pub fn calibrate_image(
    capture: &Capture,
    options: &CalibrateOptions,
) -> Result<Calibrated<PosedFrame>, CalibrateError> {
    if options.lens == AUTO && options.camera.is_none() {
        return fit_best_lens(capture, options, &calibrate_image_with_lens);
    }
    calibrate_image_with_lens(capture, options)
}

/// The same with the lens model that the options name.
fn calibrate_image_with_lens(
    capture: &Capture,
    options: &CalibrateOptions,
) -> Result<Calibrated<PosedFrame>, CalibrateError> {
    let _stage = options.progress.stage("image calibration");
    let options = &options.for_board(&capture.target);
    let capture = with_homographies(capture);
    let (lens, order) = requested(&options.lens);
    let mut camera = match &options.camera {
        Some(camera) => camera.clone(),
        None => {
            let markers: Vec<FrameMarkers<'_>> = capture.frames.iter().map(markers_of).collect();
            start_camera(&capture.target, capture.width, capture.height, &markers, &lens, &options.register)?
        }
    };
    let mut depth_only = options.register.depth_blocks(&options.model)?;
    for effect in &options.effects {
        let block = options.register.make(effect, None)?;
        if is_depth_only(&block) {
            depth_only.push(block);
        } else {
            camera = camera.with_block(block);
        }
    }
    let is_declared = options.camera.is_some();
    let blocks: Vec<&Block> = camera.blocks().iter().chain(&depth_only).collect();
    check(&options.held, blocks.iter().copied(), is_declared)?;
    camera = hold(&camera, &options.held, is_declared);
    let capture = posed(&capture, &camera);
    if capture.frames.is_empty() {
        return Err(StartError::TooFewFrames { found: 0, needed: FEWEST_FRAMES }.into());
    }
    let noise =
        NoiseModel { pixel_sigma: 0.3, depth: DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 }, planes: PlaneScatter::NONE };
    let rules = Rules {
        with_depth: false,
        freedom: Freedom::FromCovariance,
        last_to_drop: 0,
        most_rounds: 2 * ROUNDS + 1,
        depth_noise_settled: 0.0,
        chooses_smoothness: false,
        repair: &repair,
    };
    let is_chosen = !is_declared && order.is_none() && camera.block(BROWN_CONRADY).is_some();
    if !is_declared {
        camera = order.unwrap_or(LensOrder::Full).of_camera(&camera);
    }
    let start = State { capture, camera, noise, smoothness: Smoothness::default() };
    if is_chosen { settle_with_chosen_lens(&start, &rules, options) } else { settle(start, &rules, options) }
}
