//! A declared lens of many terms, where the captures do not determine all of them: those of the highest orders keep the declared
//! values.

use depthcal_model::{Block, Camera};
use tracing::warn;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::lens_choice::{DETERMINED_PX, corner_deviation_px};
use super::rules::Rules;
use super::settle::settle;
use crate::adjust::state::{CameraState, State};
use crate::observe::PosedFrame;

/// The lens of OpenCV with its terms k1 k2 p1 p2 k3 k4 k5 k6 and more.
const OPENCV_LENS: &str = "opencv_lens";
/// Terms that are fitted, fewer and fewer: those of Brown and Conrady, these without k3, none.
const FITTED: [usize; 3] = [5, 4, 0];

/// Settles a calibration from images that starts from a declared camera. Where the markers leave terms of its lens undetermined,
/// those of the highest orders are held at their declared values, which is said.
pub(super) fn settle_with_declared_lens(
    start: &CameraState<PosedFrame>,
    rules: &Rules<'_, PosedFrame>,
    options: &CameraOptions,
) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
    let settled = |camera: Camera| -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
        Ok(settle(State::of_camera(CameraState { camera, ..start.clone() }), rules, options)?.only_camera(options))
    };
    let free = |camera: &Camera| camera.block(OPENCV_LENS).map(|block| block.free.clone());
    let whole = settled(start.camera.clone());
    let is_lens_at_fault = match &whole {
        Ok(fit) => !is_determined(fit),
        Err(error) => error.is_untrusted_fit(),
    };
    if !is_lens_at_fault || free(&start.camera).is_none() {
        return whole;
    }
    let mut tried = start.camera.clone();
    for fitted in FITTED {
        let camera = with_fitted(&start.camera, fitted);
        if free(&camera) == free(&tried) {
            continue;
        }
        if let Ok(fit) = settled(camera.clone())
            && is_determined(&fit)
        {
            warn_of_held(&start.camera, &fit);
            return Ok(fit);
        }
        tried = camera;
    }
    // What is at fault besides the lens is said of the lens that was declared.
    whole
}

/// Whether the frames determine the lens up to the border of the image.
fn is_determined(fit: &CalibratedCamera<PosedFrame>) -> bool {
    corner_deviation_px(fit) <= DETERMINED_PX
}

/// The camera with the terms of its lens from this number on held.
fn with_fitted(camera: &Camera, fitted: usize) -> Camera {
    camera.map_blocks(|mut block: Block| {
        if block.name() == OPENCV_LENS {
            block.free.iter_mut().skip(fitted).for_each(|free| *free = false);
        }
        block
    })
}

fn warn_of_held(declared: &Camera, fit: &CalibratedCamera<PosedFrame>) {
    let (Some(before), Some(after)) = (declared.block(OPENCV_LENS), fit.camera.block(OPENCV_LENS)) else { return };
    let held = before.parameters().iter().zip(before.free.iter().zip(&after.free));
    let held: Vec<&str> = held.filter(|(_, (was, is))| **was && !**is).map(|(p, _)| p.name.as_ref()).collect();
    warn!(
        "the {} frames of {} leave {} of the declared lens undetermined: held at the declared values; frames with the board in the \
         corners of the image, near and tilted, determine them, and lens = \"brown-conrady\" does without k4 and beyond",
        fit.capture.frames.len(),
        fit.capture.name,
        held.join(" ")
    );
}
