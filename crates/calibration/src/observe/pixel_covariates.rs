//! The covariates of a frame's board pixels. They take more memory than all else that is known of a pixel, and few steps need
//! them: they are computed where they are asked for.

use std::borrow::Cow;

use depthcal_model::frame_covariates::Surroundings;
use depthcal_model::{Context, FrameCovariates};

use super::frame_light::{light, stray_at};
use super::pixel_rays::PixelRays;
use super::stages::OpenFrame;

/// The covariates of the pixels of a part of a frame's depth image, or of the frame's single pixels.
#[derive(Debug)]
pub struct PixelCovariates<'a> {
    frame: &'a OpenFrame<'a>,
    /// Amplitude around the pixels, where a piece needs it.
    surroundings: Option<Surroundings>,
    /// Light of the frame, where a piece needs it.
    light: Option<Cow<'a, FrameCovariates>>,
}

impl<'a> PixelCovariates<'a> {
    /// Of the pixels from column and row `low` to `high`, both included; of surroundings and light those that the pieces of
    /// `rays` need ([`PixelRays::needs_surroundings`], [`PixelRays::modulation`]). `unit_mm` is the unit of the depth image.
    pub(super) fn of_part(
        frame: &'a OpenFrame<'a>,
        unit_mm: f64,
        rays: &PixelRays<'_>,
        (low, high): ([usize; 2], [usize; 2]),
    ) -> Self {
        let image = frame.image.as_deref().filter(|_| rays.needs_surroundings());
        let surroundings = image.map(|i| Surroundings::of(&i.data, [i.width, i.height], low, high));
        Self { frame, surroundings, light: light(frame, unit_mm, rays) }
    }

    /// Of single pixels, which come with theirs, or of none.
    pub(super) fn given(frame: &'a OpenFrame<'a>) -> Self {
        Self { frame, surroundings: None, light: None }
    }

    /// The covariates of the pixel with this number in the depth image, row by row, or among the single pixels; those of its
    /// surroundings where a piece needs them.
    pub fn context(&self, number: u32, pixel: [f64; 2]) -> Context {
        let context = self.without_light(number, pixel);
        if self.frame.depth.is_none() {
            return context;
        }
        let stray = stray_at(self.light.as_deref(), self.frame.image.as_deref(), pixel);
        Context { stray, ..context }
    }

    /// [`context`](Self::context) with the pixel's surroundings, whether or not a piece needs them.
    pub fn complete(&self, number: u32, pixel: [f64; 2]) -> Context {
        let context = self.context(number, pixel);
        let is_complete = self.surroundings.is_some() || self.frame.depth.is_none();
        if is_complete { context } else { Context { stray: context.stray, ..self.frame.context(pixel) } }
    }

    /// [`context`](Self::context) without the light of the frame.
    pub(super) fn without_light(&self, number: u32, pixel: [f64; 2]) -> Context {
        if let Some(given) = self.frame.raw.depth_pixels().get(number as usize) {
            return given.context;
        }
        let mut context = self.frame.conditions(pixel);
        if let Some(surroundings) = &self.surroundings {
            let [u, v] = pixel.map(|c| c as usize);
            (context.surround, context.slope) = surroundings.at(u, v);
        }
        context
    }
}
