//! The public functions of the correction, which check their arguments.

use depthcal_io::DepthImage;
use depthcal_model::Camera;
use depthcal_model::uncertainty::UncertainDepth;

use crate::error::CorrectorError;
use crate::frame_context::FrameContext;
use crate::needs::Needs;
use crate::pass::{self, Input, Output};
use crate::points::PointsMut;
use crate::prepared::PreparedCamera;
use crate::summary::CorrectionSummary;
use crate::uncertainty::{LazyVolume, UncertaintyVolume};

/// Corrects the depth images of a calibrated camera, at its calibrated resolution. Build it once, then use it for every
/// frame.
///
/// See the [crate's front page](crate) for an example and for the conventions on invalid depth, rays and ends of types.
#[derive(Debug, Clone)]
pub struct Corrector {
    prepared: PreparedCamera,
    uncertainty: Option<LazyVolume>,
}

impl Corrector {
    /// Prepares the correction for a camera: computes the rays of all pixels and the tables of its depth pieces.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Empty`] where the camera has no pixels, [`CorrectorError::NoRay`] where none of its pixels has
    /// a ray.
    pub fn new(camera: &Camera) -> Result<Self, CorrectorError> {
        Ok(Self { prepared: PreparedCamera::new(camera)?, uncertainty: None })
    }

    /// The corrector with the uncertainty of its camera's depth. It is evaluated on a grid over image and distance when it is
    /// asked for the first time, which takes a tenth of a second or so.
    #[must_use]
    pub fn with_uncertainty(self, depth: UncertainDepth) -> Self {
        Self { uncertainty: Some(LazyVolume::new(depth)), ..self }
    }

    /// Width of the images, px.
    pub fn width(&self) -> usize {
        self.prepared.camera.width
    }

    /// Height of the images, px.
    pub fn height(&self) -> usize {
        self.prepared.camera.height
    }

    /// Quantities that the camera's effects depend on besides depth and pixel. An effect of a quantity that a frame
    /// does not bring is not corrected.
    pub fn needs(&self) -> Needs {
        self.prepared.needs
    }

    /// Whether frames are corrected by tables. If not, every pixel is inverted on its own, which takes some hundred
    /// times as long.
    pub fn has_tables(&self) -> bool {
        self.prepared.plan.is_some()
    }

    /// Corrects a depth image with steps of `unit_mm` into `out`, in the same steps.
    ///
    /// Results are rounded to within 0.501 steps of the exact inverse: a value less than a thousandth of a step from
    /// the middle between two steps may be rounded to either. Results are limited to 1 … 65535, so that rounding never
    /// makes a valid depth invalid (0) and no value wraps.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Size`] or [`CorrectorError::Length`] where `depth`, `out` or the amplitude image do not have
    /// the calibrated resolution, [`CorrectorError::Unit`] where `unit_mm` is not positive and finite; `out` is then
    /// unchanged.
    pub fn correct_u16(
        &self,
        depth: &DepthImage,
        unit_mm: f64,
        context: &FrameContext<'_>,
        out: &mut DepthImage,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_size("the depth image", (depth.width, depth.height), depth.data.len())?;
        self.check_size("the output image", (out.width, out.height), out.data.len())?;
        self.correct_u16_buffer(&depth.data, unit_mm, context, &mut out.data)
    }

    /// [`Corrector::correct_u16`] for raw buffers, e.g. from a driver: row-major, one value per pixel. Fastest where
    /// both buffers begin at a multiple of 64 bytes.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_u16`].
    pub fn correct_u16_buffer(
        &self,
        depth: &[u16],
        unit_mm: f64,
        context: &FrameContext<'_>,
        out: &mut [u16],
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth.len())?;
        self.check_length("the output", out.len())?;
        self.check_frame(unit_mm, context)?;
        Ok(pass::correct(&self.prepared, Input::U16(depth), unit_mm, context, Output::U16(out)))
    }

    /// [`Corrector::correct_u16_buffer`] in place.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_u16`].
    pub fn correct_u16_buffer_in_place(
        &self,
        depth: &mut [u16],
        unit_mm: f64,
        context: &FrameContext<'_>,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth.len())?;
        self.check_frame(unit_mm, context)?;
        Ok(pass::correct(&self.prepared, Input::Output, unit_mm, context, Output::U16(depth)))
    }

    /// Corrects a depth image with steps of `unit_mm` into mm, one value per pixel, not rounded to steps.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_u16`].
    pub fn correct_u16_to_f32(
        &self,
        depth: &DepthImage,
        unit_mm: f64,
        context: &FrameContext<'_>,
        out_mm: &mut [f32],
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_size("the depth image", (depth.width, depth.height), depth.data.len())?;
        self.correct_u16_buffer_to_f32(&depth.data, unit_mm, context, out_mm)
    }

    /// [`Corrector::correct_u16_to_f32`] of a raw buffer: row-major, one value per pixel.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_u16`].
    pub fn correct_u16_buffer_to_f32(
        &self,
        depth: &[u16],
        unit_mm: f64,
        context: &FrameContext<'_>,
        out_mm: &mut [f32],
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth.len())?;
        self.check_length("the output", out_mm.len())?;
        self.check_frame(unit_mm, context)?;
        Ok(pass::correct(&self.prepared, Input::U16(depth), unit_mm, context, Output::F32(out_mm)))
    }

    /// Corrects depth in mm into `out_mm`; both are row-major with one value per pixel.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where a buffer, or [`CorrectorError::Size`] where the amplitude image, does not have
    /// the calibrated resolution; `out_mm` is then unchanged.
    pub fn correct_f32(
        &self,
        depth_mm: &[f32],
        context: &FrameContext<'_>,
        out_mm: &mut [f32],
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth_mm.len())?;
        self.check_length("the output", out_mm.len())?;
        self.check_frame(1.0, context)?;
        Ok(pass::correct(&self.prepared, Input::F32(depth_mm), 1.0, context, Output::F32(out_mm)))
    }

    /// [`Corrector::correct_f32`] in place.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_f32`].
    pub fn correct_f32_in_place(
        &self,
        depth_mm: &mut [f32],
        context: &FrameContext<'_>,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth_mm.len())?;
        self.check_frame(1.0, context)?;
        Ok(pass::correct(&self.prepared, Input::Output, 1.0, context, Output::F32(depth_mm)))
    }

    /// Corrects a depth image with steps of `unit_mm` and back-projects it in the same pass: one point per pixel, in mm
    /// in the camera frame; NaN where there is no corrected depth.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_u16`].
    pub fn correct_to_points(
        &self,
        depth: &DepthImage,
        unit_mm: f64,
        context: &FrameContext<'_>,
        out: PointsMut<'_>,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_size("the depth image", (depth.width, depth.height), depth.data.len())?;
        self.correct_u16_buffer_to_points(&depth.data, unit_mm, context, out)
    }

    /// [`Corrector::correct_to_points`] of a raw buffer: row-major, one value per pixel.
    ///
    /// # Errors
    ///
    /// As [`Corrector::correct_u16`].
    pub fn correct_u16_buffer_to_points(
        &self,
        depth: &[u16],
        unit_mm: f64,
        context: &FrameContext<'_>,
        out: PointsMut<'_>,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth.len())?;
        self.check_points(&out)?;
        self.check_frame(unit_mm, context)?;
        Ok(pass::correct(&self.prepared, Input::U16(depth), unit_mm, context, Output::Points(out)))
    }

    /// Standard deviation of the corrected depth of every pixel, mm, from depth as measured in steps of `unit_mm`: noise of the
    /// pixel and uncertainty of the parameters, under the conditions in the middle of those of the fit. NaN where nothing was
    /// measured, or where it cannot be corrected. Within 2 % of what [`UncertainDepth::std_dev`] gives; where depth is far
    /// beyond the boards, the ratio to depth is kept.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::NoUncertainty`] without [`Corrector::with_uncertainty`], [`CorrectorError::Length`] and
    /// [`CorrectorError::Unit`] as for [`Corrector::correct_u16`]; `out_mm` is then unchanged.
    pub fn uncertainty_u16(&self, depth: &[u16], unit_mm: f64, out_mm: &mut [f32]) -> Result<(), CorrectorError> {
        self.check_length("the depth", depth.len())?;
        self.check_length("the output", out_mm.len())?;
        self.check_frame(unit_mm, &FrameContext::default())?;
        let unit_mm = unit_mm as f32;
        let measured = |i: usize| if depth[i] == u16::MAX { 0.0 } else { f32::from(depth[i]) * unit_mm };
        self.volume()?.sigmas(measured, out_mm);
        Ok(())
    }

    /// [`Corrector::uncertainty_u16`] for measured depth in mm.
    ///
    /// # Errors
    ///
    /// As [`Corrector::uncertainty_u16`].
    pub fn uncertainty_f32(&self, depth_mm: &[f32], out_mm: &mut [f32]) -> Result<(), CorrectorError> {
        self.check_length("the depth", depth_mm.len())?;
        self.check_length("the output", out_mm.len())?;
        let measured = |i: usize| if depth_mm[i].is_finite() { depth_mm[i] } else { 0.0 };
        self.volume()?.sigmas(measured, out_mm);
        Ok(())
    }

    /// Where the calibration is supported, from corrected depth in mm: every pixel becomes one of [`Supported`].
    ///
    /// # Errors
    ///
    /// As [`Corrector::uncertainty_u16`].
    ///
    /// [`Supported`]: crate::Supported
    pub fn support(&self, corrected_mm: &[f32], out: &mut [u8]) -> Result<(), CorrectorError> {
        self.check_length("the depth", corrected_mm.len())?;
        self.check_length("the output", out.len())?;
        let corrected = |i: usize| if corrected_mm[i].is_finite() { corrected_mm[i] } else { 0.0 };
        self.volume()?.support(corrected, out);
        Ok(())
    }

    /// The points of a depth image that is corrected already, with steps of `unit_mm`: one per pixel, row-major, [x, y,
    /// z] in mm in the camera frame; NaN where there is no depth or no ray.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Size`] or [`CorrectorError::Length`] where the image does not have the calibrated resolution,
    /// [`CorrectorError::Unit`] where `unit_mm` is not positive and finite.
    pub fn points(&self, corrected: &DepthImage, unit_mm: f64) -> Result<Vec<[f32; 3]>, CorrectorError> {
        let mut points = vec![[f32::NAN; 3]; self.prepared.pixels()];
        self.points_into(corrected, unit_mm, PointsMut::Interleaved(points.as_flattened_mut()))?;
        Ok(points)
    }

    /// [`Corrector::points`] into a given buffer.
    ///
    /// # Errors
    ///
    /// As [`Corrector::points`], and [`CorrectorError::Length`] for `out`.
    pub fn points_into(&self, corrected: &DepthImage, unit_mm: f64, out: PointsMut<'_>) -> Result<(), CorrectorError> {
        self.check_size("the depth image", (corrected.width, corrected.height), corrected.data.len())?;
        self.check_points(&out)?;
        self.check_frame(unit_mm, &FrameContext::default())?;
        pass::back_project(&self.prepared, Input::U16(&corrected.data), unit_mm, out);
        Ok(())
    }

    /// [`Corrector::points_into`] of corrected depth in mm, the output of [`Corrector::correct_f32`].
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where `corrected_mm` does not have one value per pixel, or `out` not one point.
    pub fn points_f32_into(&self, corrected_mm: &[f32], out: PointsMut<'_>) -> Result<(), CorrectorError> {
        self.check_length("the depth", corrected_mm.len())?;
        self.check_points(&out)?;
        pass::back_project(&self.prepared, Input::F32(corrected_mm), 1.0, out);
        Ok(())
    }

    fn check_size(&self, what: &'static str, size: (usize, usize), length: usize) -> Result<(), CorrectorError> {
        let expected = (self.prepared.camera.width, self.prepared.camera.height);
        if size != expected {
            return Err(CorrectorError::Size { what, found: size, expected });
        }
        self.check_length(what, length)
    }

    fn check_length(&self, what: &'static str, length: usize) -> Result<(), CorrectorError> {
        let expected = self.prepared.pixels();
        if length == expected { Ok(()) } else { Err(CorrectorError::Length { what, found: length, expected }) }
    }

    fn check_points(&self, out: &PointsMut<'_>) -> Result<(), CorrectorError> {
        let expected = self.prepared.pixels();
        let lengths = match out {
            PointsMut::Interleaved(out) => [(out.len(), 3 * expected); 3],
            PointsMut::Planes(planes) => planes.each_ref().map(|plane| (plane.len(), expected)),
        };
        match lengths.into_iter().find(|(length, expected)| length != expected) {
            Some((found, expected)) => Err(CorrectorError::Length { what: "the buffer for points", found, expected }),
            None => Ok(()),
        }
    }

    fn volume(&self) -> Result<&UncertaintyVolume, CorrectorError> {
        self.uncertainty.as_ref().map(LazyVolume::get).ok_or(CorrectorError::NoUncertainty)
    }

    fn check_frame(&self, unit_mm: f64, context: &FrameContext<'_>) -> Result<(), CorrectorError> {
        if !(unit_mm.is_finite() && unit_mm > 0.0) {
            return Err(CorrectorError::Unit { unit_mm });
        }
        let image = context.amplitude;
        image.map_or(Ok(()), |i| self.check_size("the amplitude image", (i.width, i.height), i.data.len()))
    }
}
