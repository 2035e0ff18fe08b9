//! Quantities of a frame, besides its depth, that a correction may depend on.

use depthcal_io::GrayImage;
use depthcal_model::{Context, Quantities};

/// Quantities of a frame, besides its depth, that a correction may depend on ([`Corrector::needs`] tells which). An
/// effect of a quantity that is unknown is not corrected.
///
/// [`Corrector::needs`]: crate::Corrector::needs
#[derive(Debug, Clone, Copy)]
pub struct FrameContext<'a> {
    /// Time since the first frame of the recording, s; 0 where unknown.
    pub time_s: f64,
    /// Temperature, °C; NaN where unknown.
    pub temperature_c: f64,
    /// Further quantities, such as the exposure; those that are unknown are not among them.
    pub quantities: Quantities,
    /// Infrared amplitude on the pixel grid of the depth image.
    pub amplitude: Option<AmplitudeImage<'a>>,
}

/// An infrared image that is borrowed from whoever has it.
#[derive(Debug, Clone, Copy)]
pub struct AmplitudeImage<'a> {
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// `height` × `width` values, row-major, in steps of the images that the camera was calibrated with.
    pub data: &'a [u16],
}

impl<'a> From<&'a GrayImage> for AmplitudeImage<'a> {
    fn from(image: &'a GrayImage) -> Self {
        Self { width: image.width, height: image.height, data: &image.data }
    }
}

impl Default for FrameContext<'_> {
    fn default() -> Self {
        Self { time_s: 0.0, temperature_c: f64::NAN, quantities: Quantities::NONE, amplitude: None }
    }
}

impl FrameContext<'_> {
    /// The model's context at a pixel, given by its coordinates and its row-major index.
    pub(crate) fn at(&self, pixel: [f64; 2], index: usize) -> Context {
        let amplitude = self.amplitude.map_or(f64::NAN, |image| f64::from(image.data[index]));
        Context { pixel, amplitude, ..self.of_frame() }
    }

    /// The part of the model's context that is the same at all pixels.
    pub(crate) fn of_frame(&self) -> Context {
        let Self { time_s, temperature_c, quantities, .. } = *self;
        Context { time_s, temperature_c, quantities, ..Context::default() }
    }
}
