//! The light of whole frames, for effects that depend on it. It is computed once per frame, when its depth is sampled, and kept
//! with the frame: images leave memory, it is small.

use std::borrow::Cow;
use std::sync::Arc;

use depthcal_io::{GrayImage, ImageError};
use depthcal_model::{Context, FrameCovariates, Modulation, StrayLight};
use rayon::prelude::*;

use super::camera_frames::CameraFrames;
use super::kept_light::FrameLight;
use super::pixel_rays::PixelRays;
use super::stages::{DepthSample, OpenFrame, PosedFrame, SampledFrame};

/// Computes the light of all frames and keeps it with them.
pub(super) fn keep_light(capture: &mut CameraFrames<PosedFrame>, rays: &PixelRays<'_>) -> Result<(), ImageError> {
    let Some(modulation) = rays.modulation() else { return Ok(()) };
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    capture.frames.par_iter_mut().try_for_each(|frame| {
        let covariates = compute(&frame.open()?, modulation, unit_mm, rays).map(Arc::new);
        frame.light = Some(FrameLight { modulation, covariates });
        Ok(())
    })
}

/// The light of a frame that the pieces of `rays` need: that which is kept with it, else computed. `None` where none is needed,
/// or the frame has no image or no depth.
pub(super) fn light<'a>(frame: &OpenFrame<'a>, unit_mm: f64, rays: &PixelRays<'_>) -> Option<Cow<'a, FrameCovariates>> {
    let modulation = rays.modulation()?;
    match &frame.raw.light {
        Some(kept) if kept.modulation == modulation => kept.covariates.as_deref().map(Cow::Borrowed),
        _ => compute(frame, modulation, unit_mm, rays).map(Cow::Owned),
    }
}

/// The depth samples of a frame with light of other modulation frequencies than those that they were sampled with.
///
/// # Errors
///
/// [`ImageError`] where an image has become unreadable.
pub(crate) fn relit(
    frame: &SampledFrame,
    modulation: Modulation,
    unit_mm: f64,
    rays: &PixelRays<'_>,
) -> Result<SampledFrame, ImageError> {
    let open = frame.open()?;
    let covariates = compute(&open, modulation, unit_mm, rays);
    let light = |pixel: [f64; 2]| stray_at(covariates.as_ref(), open.image.as_deref(), pixel);
    let with_light =
        |s: &DepthSample| DepthSample { context: Context { stray: light(s.context.pixel), ..s.context }, ..*s };
    let samples: Vec<DepthSample> = frame.samples.iter().map(with_light).collect();
    Ok(SampledFrame { posed: frame.posed.clone(), samples: samples.into() })
}

/// The light that the lens spreads over a pixel of the depth image, from the light of its frame; unknown where this is.
pub(super) fn stray_at(light: Option<&FrameCovariates>, image: Option<&GrayImage>, pixel: [f64; 2]) -> StrayLight {
    let known = light.zip(image);
    known.map_or(StrayLight::UNKNOWN, |(light, image)| light.at(&image.data, pixel.map(|c| c as usize)))
}

fn compute(
    frame: &OpenFrame<'_>,
    modulation: Modulation,
    unit_mm: f64,
    rays: &PixelRays<'_>,
) -> Option<FrameCovariates> {
    let (image, depth) = (frame.image.as_deref()?, frame.depth.as_deref()?);
    let camera = rays.camera();
    if (depth.width, depth.height) != (camera.width, camera.height) || depth.len() != image.data.len() {
        return None;
    }
    let range = |index: usize| {
        depth.measurement(index).map_or(0.0, |raw| {
            let depth_mm = raw * unit_mm;
            (depth_mm * rays.slant(index, depth_mm)) as f32
        })
    };
    FrameCovariates::new(modulation, [depth.width, depth.height], &image.data, range)
}
