//! Camera, lens and poses from the markers alone.

use depthcal_model::{Block, Camera};
use tracing::warn;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::declared_lens::settle_with_declared_lens;
use super::error::CalibrateError;
use super::frame_checks::{markers_of, posed, repair, with_homographies, without_gross_markers};
use super::held::{check, hold};
use super::lens_choice::settle_with_chosen_lens;
use super::lens_comparison::{AUTO, fit_best_lens};
use super::lens_order::{BROWN_CONRADY, LensOrder, requested};
use super::model_blocks::{depth_blocks, image_blocks};
use super::needed_quantities::check_quantities;
use super::rules::{Freedom, ROUNDS, Rules};
use super::settle::settle;
use crate::adjust::state::{CameraState, State};
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter};
use crate::observe::{CameraFrames, PosedFrame};
use crate::start::{FEWEST_FRAMES, FrameMarkers, StartError, lens_block, start_camera};

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
    capture: &CameraFrames,
    options: &CameraOptions,
) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
    if options.lens == AUTO && options.camera.is_none() {
        return fit_best_lens(capture, options, &calibrate_image_with_lens);
    }
    calibrate_image_with_lens(capture, options)
}

/// [`calibrate_image`]; where it fails because the board is another than the declared one, that is the error.
///
/// # Errors
///
/// [`CalibrateError`], where the captures do not determine the camera.
pub(crate) fn calibrate_image_or_cause(
    capture: &CameraFrames,
    options: &CameraOptions,
) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
    check_quantities(capture, options)?;
    let result = calibrate_image(capture, options).inspect(hint_at_stretched_board);
    #[cfg(feature = "detect")]
    let result = result.map_err(|error| {
        // Boards are parallel only as far as their markers agree with the declared ones.
        let is_of_markers = !matches!(
            error,
            CalibrateError::Register(_)
                | CalibrateError::UnknownHeld { .. }
                | CalibrateError::Start(StartError::ParallelBoards { .. })
        );
        let frames = capture.frames.iter().filter(|_| is_of_markers).map(|frame| &frame.raw);
        match crate::cause::board_cause(&capture.target, frames) {
            Some(cause) => CalibrateError::Board { cause: Box::new(cause), source: Box::new(error) },
            None => error,
        }
    });
    result
}

/// Warns of focal lengths that differ more than those of a camera do: the print is stretched.
fn hint_at_stretched_board(calibrated: &CalibratedCamera<PosedFrame>) {
    /// Relative difference from which on it is no camera's: pixels of today's sensors are square.
    const STRETCHED: f64 = 0.02;
    let [fx, fy, ..] = calibrated.camera.pinhole();
    let ratio = fy / fx;
    if (ratio - 1.0).abs() > STRETCHED {
        warn!(
            "the focal lengths of {} differ by {:.1} % (fx {fx:.0} px, fy {fy:.0} px): if its pixels are square, the squares of the board are not, and \
             its print is stretched; measure the spacing along columns and rows (diagnose has the effect print_scale)",
            calibrated.capture.name,
            100.0 * (ratio - 1.0).abs()
        );
    }
}

/// [`calibrate_image`] with the lens model that the options name.
fn calibrate_image_with_lens(
    capture: &CameraFrames,
    options: &CameraOptions,
) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
    let _stage = options.progress.stage("image calibration");
    let options = &options.for_board(&capture.target);
    let capture = &without_gross_markers(capture);
    let capture = with_homographies(capture);
    let (lens, order) = requested(&options.lens);
    let declared = options.camera.clone();
    let is_declared = declared.is_some();
    let of_prior = if is_declared { None } else { prior_camera(&capture, &lens, options)? };
    let has_lens_of_prior = of_prior.is_some();
    let mut camera = match declared.or(of_prior) {
        Some(camera) => camera,
        None => {
            let markers: Vec<FrameMarkers<'_>> = capture.frames.iter().map(markers_of).collect();
            start_camera(&capture.target, capture.width, capture.height, &markers, &lens, &options.register)?
        }
    };
    for block in image_blocks(options)? {
        camera = camera.with_block(block);
    }
    let depth_only = depth_blocks(options)?;
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
        repair: Some(&repair),
    };
    let is_chosen = !is_declared && !has_lens_of_prior && order.is_none() && camera.block(BROWN_CONRADY).is_some();
    if !is_declared && (!has_lens_of_prior || order.is_some()) {
        camera = order.unwrap_or(LensOrder::Full).of_camera(&camera);
    }
    let start = CameraState { prior: options.prior.clone(), ..CameraState::reference(capture, camera, noise) };
    if is_chosen {
        return settle_with_chosen_lens(&start, &rules, options);
    }
    if is_declared {
        return settle_with_declared_lens(&start, &rules, options);
    }
    Ok(settle(State::of_camera(start), &rules, options)?.only_camera(options))
}

/// The camera at the mean of the options' prior, with the lens terms free that the prior's units have; `None` where there is no
/// prior, or where it does not tell pinhole and lens.
fn prior_camera<F>(
    capture: &CameraFrames<F>,
    lens: &str,
    options: &CameraOptions,
) -> Result<Option<Camera>, CalibrateError> {
    let Some(prior) = &options.prior else { return Ok(None) };
    let pinhole = ["fx", "fy", "cx", "cy"].map(|name| prior.mean_of(&format!("pinhole.{name}")));
    let [Some(fx), Some(fy), Some(cx), Some(cy)] = pinhole else { return Ok(None) };
    let mut blocks = Vec::new();
    if let Some(mut block) = lens_block(lens, &options.register)? {
        let name = block.name();
        let known: Vec<bool> =
            block.parameters().iter().map(|p| prior.mean_of(&format!("{name}.{}", p.name)).is_some()).collect();
        if !known.contains(&true) {
            return Ok(None);
        }
        for (free, known) in block.free.iter_mut().zip(known) {
            *free &= known;
        }
        blocks.push(block);
    }
    let camera = Camera::new(capture.width, capture.height, [fx, fy, cx, cy, 0.0], blocks);
    Ok(Some(prior.start(&camera)))
}
