//! Correction of depth images with a calibrated camera: built once, then applied to every frame.
//!
//! A [`Corrector`] keeps what does not change from frame to frame: the true ray of every pixel, and the inverse of the depth
//! pieces as tables (see `plan`). A frame then goes through in one pass, in bands on the threads of the present rayon pool,
//! each band in chunks that stay in the first-level cache; the loops are compiled for several instruction sets and chosen
//! at run time (see `simd`). Where the tables do not reach, a pixel is inverted by [`Camera`] in f64. Corrected depth stays
//! at the pixels of the depth image: pieces at the hook `pixel` decide which ray a depth pixel has, nothing is moved.
//!
//! Invalid depth (0, for f32 also what is negative or not finite) stays invalid (0). Pixels that see no ray, or whose
//! depth the model cannot invert, become invalid and are counted. Results saturate at the ends of their type.

mod aligned;
mod bands;
mod bins;
mod cubics;
mod curve;
mod depth_table;
mod error;
mod formats;
mod incidence;
mod invert;
mod lookup;
mod moebius;
mod pass;
mod plan;
mod points;
mod probe;
mod rays;
mod remap;
mod separable;
mod simd;
mod steps;

use std::ops::{Add, AddAssign};

use depthcal_io::{DepthImage, GrayImage};
use depthcal_model::{Camera, Context};
use rayon::prelude::*;

use cubics::RayCubics;
use pass::{Input, Output};
use plan::{Frame, Plan};
use simd::{Isa, Kernel, dispatch};
use steps::Bounds;

pub use error::CorrectorError;
pub use points::PointsMut;
pub use probe::Needs;
pub use rays::Rays;
pub use remap::{Remap, Texel};

/// What is known of a frame beside its depth, for the effects that depend on it. See [`Corrector::needs`].
#[derive(Debug, Clone, Copy)]
pub struct FrameContext<'a> {
    /// Time since the first frame of the recording, s; 0 where unknown.
    pub time_s: f64,
    /// Temperature, °C; NaN where unknown.
    pub temperature_c: f64,
    /// Infrared amplitude on the pixel grid of the depth image.
    pub amplitude: Option<&'a GrayImage>,
}

impl Default for FrameContext<'_> {
    fn default() -> Self {
        Self { time_s: 0.0, temperature_c: f64::NAN, amplitude: None }
    }
}

impl FrameContext<'_> {
    fn at(&self, pixel: [f64; 2], index: usize) -> Context {
        let amplitude = self.amplitude.map_or(f64::NAN, |image| f64::from(image.data[index]));
        Context { pixel, amplitude, ..self.of_frame() }
    }

    /// What all pixels share.
    fn of_frame(&self) -> Context {
        Context { time_s: self.time_s, temperature_c: self.temperature_c, ..Context::default() }
    }
}

/// What became of the pixels of one frame, or of many added up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CorrectionSummary {
    /// Pixels with a corrected depth.
    pub corrected: usize,
    /// Those of them whose corrected depth lies beyond the range of its type and was set to the nearest end.
    pub saturated: usize,
    /// Pixels that had no depth.
    pub invalid: usize,
    /// Pixels that had a depth but have none now: without a ray, or where the model has no inverse.
    pub not_correctable: usize,
}

impl Add for CorrectionSummary {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            corrected: self.corrected + other.corrected,
            saturated: self.saturated + other.saturated,
            invalid: self.invalid + other.invalid,
            not_correctable: self.not_correctable + other.not_correctable,
        }
    }
}

impl AddAssign for CorrectionSummary {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// Corrects the depth images of one camera at its calibrated resolution.
///
/// ```
/// use depthcal::corrector::{Corrector, FrameContext};
/// use depthcal_io::DepthImage;
/// use depthcal_model::{Camera, Register};
///
/// // Depth that is measured 2 % too near: ρ_m = 1.02 ρ.
/// let mut projective = Register::builtin().block("projective", None)?;
/// projective.theta = vec![0.0, 0.0, 0.0, 1.02];
/// let camera = Camera::new(4, 3, [500.0, 500.0, 1.5, 1.0, 0.0], vec![projective]);
/// let corrector = Corrector::new(&camera)?;
///
/// let measured = DepthImage { width: 4, height: 3, data: vec![1000; 12] };
/// let mut corrected = measured.clone();
/// let summary = corrector.correct_u16(&measured, 1.0, &FrameContext::default(), &mut corrected)?;
/// assert_eq!((summary.corrected, corrected.data[0]), (12, 1020));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Corrector {
    camera: Camera,
    needs: Needs,
    /// True ray of every pixel, NaN where there is none; at a typical depth where it depends on that.
    rays: Vec<[f64; 2]>,
    /// The same, x and y.
    ray_planes: [Vec<f32>; 2],
    /// The same as cubics.
    ray_cubics: RayCubics,
    rays_are_fixed: bool,
    /// `None` where every pixel is inverted by the camera.
    plan: Option<Plan>,
    /// Where the plan is one Möbius map.
    bounds: Option<Bounds>,
}

impl Corrector {
    /// Prepares the correction for a camera: rays of all pixels, and the tables of its depth pieces.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Empty`], and [`CorrectorError::NoRay`] where the camera maps no pixel to a ray.
    pub fn new(camera: &Camera) -> Result<Self, CorrectorError> {
        let (width, height) = (camera.width, camera.height);
        if width == 0 || height == 0 {
            return Err(CorrectorError::Empty { width, height });
        }
        let mut planes = [vec![0.0; width * height], vec![0.0; width * height]];
        let [x, y] = &mut planes;
        Rays::new(camera).double([x, y])?;
        let rays: Vec<[f64; 2]> = planes[0].iter().zip(&planes[1]).map(|(x, y)| [*x, *y]).collect();
        let first = camera.ray(camera.image_pixel(&Context::default()), probe::TYPICAL_RHO);
        if let (true, Err(source)) = (rays.iter().all(|r| r[0].is_nan()), first) {
            return Err(CorrectorError::NoRay { source });
        }
        let needs = probe::needs(camera);
        let rays_are_fixed = probe::rays_are_fixed(camera);
        let plan = if rays_are_fixed {
            Plan::of_pieces(camera, &rays)
        } else if needs == Needs::default() {
            Plan::of_chain(camera, &probe::samples(camera, &rays), |i| !rays[i][0].is_nan())
        } else {
            None
        };
        let mut ray_planes = [0, 1].map(|k| rays.iter().map(|ray| ray[k] as f32).collect());
        let ray_cubics = RayCubics::new(&rays, &mut ray_planes);
        let camera = camera.clone();
        let mut corrector = Self { camera, needs, rays, ray_planes, ray_cubics, rays_are_fixed, plan, bounds: None };
        corrector.plan = corrector.plan.take().and_then(|mut plan| {
            plan.error_mm = corrector.error_of(&plan)?;
            Some(plan)
        });
        let map = corrector.plan.as_ref().and_then(Plan::only_moebius);
        corrector.bounds = map.map(|map| Bounds::new(map, width * height));
        Ok(corrector)
    }

    /// Width of the images, px.
    pub fn width(&self) -> usize {
        self.camera.width
    }

    /// Height of the images, px.
    pub fn height(&self) -> usize {
        self.camera.height
    }

    /// What the camera's effects depend on beside depth and pixel. What a frame does not give has no effect.
    pub fn needs(&self) -> Needs {
        self.needs
    }

    /// Whether frames are corrected by tables; if not, every pixel is inverted on its own, which takes some hundred times
    /// as long.
    pub fn has_tables(&self) -> bool {
        self.plan.is_some()
    }

    /// Corrects a depth image of `unit_mm` per step into `out`, whose unit is the same. Results are rounded: they are within
    /// 0.501 steps of the exact inverse, that is, one that lies within a thousandth of a step of the middle between two may go
    /// either way. They end at 1 and 65535, so that valid depth never becomes invalid by rounding and never wraps.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Size`], [`CorrectorError::Length`], [`CorrectorError::Unit`]; `out` is then unchanged.
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

    /// [`Corrector::correct_u16`] between buffers that are nobody's image, such as a driver's: row-major, one value per pixel.
    /// Fastest where both begin at a multiple of 64 bytes.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`], [`CorrectorError::Size`], [`CorrectorError::Unit`]; `out` is then unchanged.
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
        Ok(self.run(Input::U16(depth), unit_mm, context, Output::U16(out)))
    }

    /// [`Corrector::correct_u16`] in place.
    ///
    /// # Errors
    ///
    /// The same.
    pub fn correct_u16_in_place(
        &self,
        depth: &mut DepthImage,
        unit_mm: f64,
        context: &FrameContext<'_>,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_size("the depth image", (depth.width, depth.height), depth.data.len())?;
        self.check_frame(unit_mm, context)?;
        Ok(self.run(Input::Output, unit_mm, context, Output::U16(&mut depth.data)))
    }

    /// Corrects a depth image of `unit_mm` per step into mm, one value per pixel, not rounded.
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
        self.check_length("the output", out_mm.len())?;
        self.check_frame(unit_mm, context)?;
        Ok(self.run(Input::U16(&depth.data), unit_mm, context, Output::F32(out_mm)))
    }

    /// Corrects depth in mm into `out_mm`; both are row-major with one value per pixel.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`], [`CorrectorError::Size`]; `out_mm` is then unchanged.
    pub fn correct_f32(
        &self,
        depth_mm: &[f32],
        context: &FrameContext<'_>,
        out_mm: &mut [f32],
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth_mm.len())?;
        self.check_length("the output", out_mm.len())?;
        self.check_frame(1.0, context)?;
        Ok(self.run(Input::F32(depth_mm), 1.0, context, Output::F32(out_mm)))
    }

    /// [`Corrector::correct_f32`] in place.
    ///
    /// # Errors
    ///
    /// The same.
    pub fn correct_f32_in_place(
        &self,
        depth_mm: &mut [f32],
        context: &FrameContext<'_>,
    ) -> Result<CorrectionSummary, CorrectorError> {
        self.check_length("the depth", depth_mm.len())?;
        self.check_frame(1.0, context)?;
        Ok(self.run(Input::Output, 1.0, context, Output::F32(depth_mm)))
    }

    /// Corrects a depth image of `unit_mm` per step and back-projects it, in one pass: organised points in mm.
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
        self.check_points(&out)?;
        self.check_frame(unit_mm, context)?;
        Ok(self.run(Input::U16(&depth.data), unit_mm, context, Output::Points(out)))
    }

    /// The points of a corrected depth image of `unit_mm` per step: one per pixel, row-major, [x, y, z] in mm in the
    /// camera frame; NaN where there is no depth or no ray.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Size`], [`CorrectorError::Length`], [`CorrectorError::Unit`].
    pub fn points(&self, corrected: &DepthImage, unit_mm: f64) -> Result<Vec<[f32; 3]>, CorrectorError> {
        let mut points = vec![[f32::NAN; 3]; self.pixels()];
        self.points_into(corrected, unit_mm, PointsMut::Interleaved(points.as_flattened_mut()))?;
        Ok(points)
    }

    /// [`Corrector::points`] into a given place.
    ///
    /// # Errors
    ///
    /// The same.
    pub fn points_into(&self, corrected: &DepthImage, unit_mm: f64, out: PointsMut<'_>) -> Result<(), CorrectorError> {
        self.check_size("the depth image", (corrected.width, corrected.height), corrected.data.len())?;
        self.check_points(&out)?;
        self.check_frame(unit_mm, &FrameContext::default())?;
        self.back_project(Input::U16(&corrected.data), unit_mm, out);
        Ok(())
    }

    /// The same for corrected depth in mm, as [`Corrector::correct_f32`] gives it.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`].
    pub fn points_f32(&self, corrected_mm: &[f32]) -> Result<Vec<[f32; 3]>, CorrectorError> {
        let mut points = vec![[f32::NAN; 3]; self.pixels()];
        self.points_f32_into(corrected_mm, PointsMut::Interleaved(points.as_flattened_mut()))?;
        Ok(points)
    }

    /// [`Corrector::points_f32`] into a given place.
    ///
    /// # Errors
    ///
    /// The same.
    pub fn points_f32_into(&self, corrected_mm: &[f32], out: PointsMut<'_>) -> Result<(), CorrectorError> {
        self.check_length("the depth", corrected_mm.len())?;
        self.check_points(&out)?;
        self.back_project(Input::F32(corrected_mm), 1.0, out);
        Ok(())
    }

    fn pixels(&self) -> usize {
        self.camera.width * self.camera.height
    }

    /// True ray of a pixel at a true inverse depth, 1/mm; NaN where there is none.
    fn ray(&self, index: usize, rho: f64) -> [f64; 2] {
        if self.rays_are_fixed {
            return self.rays[index];
        }
        let context = Context { pixel: pixel(index, self.camera.width), ..Context::default() };
        self.camera.ray(self.camera.image_pixel(&context), rho).unwrap_or(NO_RAY)
    }

    /// True depth of a measured one (mm) by the camera's inverse.
    fn invert(&self, context: &Context, index: usize, measured_mm: f64, cosine: f64) -> Option<f64> {
        if self.rays[index][0].is_nan() {
            return None;
        }
        let measured = 1.0 / measured_mm;
        let rho = if self.rays_are_fixed {
            self.camera.true_inverse_depth(context, self.rays[index], cosine, measured).ok()?
        } else {
            self.camera.correct(context, cosine, measured).ok()?.1
        };
        Some(1.0 / rho)
    }

    /// Largest deviation of a plan from the camera at sampled pixels beside that of f32, mm; `None` where it is wrong. Pieces were tried one by one
    /// and at few depths only; this tries all of them, over the depths that cameras measure.
    fn error_of(&self, plan: &Plan) -> Option<f64> {
        let amplitude = GrayImage {
            width: self.camera.width,
            height: self.camera.height,
            data: if self.needs.amplitude { vec![777; self.pixels()] } else { Vec::new() },
            bits: 16,
        };
        let cosines = self.needs.incidence.then(|| vec![0.7; self.pixels()]);
        let amplitude = self.needs.amplitude.then_some(&amplitude);
        let context = FrameContext { time_s: 431.0, temperature_c: 37.5, amplitude };
        let frame = plan.frame(&context, cosines.as_deref());
        let cosine = cosines.as_ref().map_or(1.0, |c| f64::from(c[0]));
        let samples = probe::samples(&self.camera, &self.rays);
        let of_sample = |(k, index): (usize, usize)| {
            let of_pixel = context.at(pixel(index, self.camera.width), index);
            let errors = [280.0, 517.0, 911.0, 1493.0, 2711.0, 4523.0, 7919.0].map(|depth_mm| {
                // No two samples at the same depth.
                let measured = (depth_mm * (1.0 + 1e-4 * k as f64)) as f32;
                let mut z = [measured];
                dispatch(OnePixel { plan, frame: &frame, index, z: &mut z });
                if z[0].is_nan() {
                    return 0.0;
                }
                let expected = self.invert(&of_pixel, index, f64::from(measured), cosine);
                // Beyond the working range a model may magnify whatever f32 leaves.
                expected.map_or(f64::INFINITY, |e| {
                    let beside = ((f64::from(z[0]) - e).abs() - e * f64::from(pass::OF_F32)).max(0.0);
                    beside / (e / WORKING_RANGE_MM).max(1.0).powi(2)
                })
            });
            errors.into_iter().fold(0.0, f64::max)
        };
        let error = samples.into_par_iter().enumerate().map(of_sample).reduce(|| 0.0, f64::max);
        (error < PLAN_TOLERANCE_MM).then_some(error)
    }

    fn check_size(&self, what: &'static str, found: (usize, usize), length: usize) -> Result<(), CorrectorError> {
        let expected = (self.camera.width, self.camera.height);
        if found != expected {
            return Err(CorrectorError::Size { what, found, expected });
        }
        self.check_length(what, length)
    }

    fn check_length(&self, what: &'static str, found: usize) -> Result<(), CorrectorError> {
        let expected = self.pixels();
        if found == expected { Ok(()) } else { Err(CorrectorError::Length { what, found, expected }) }
    }

    fn check_points(&self, out: &PointsMut<'_>) -> Result<(), CorrectorError> {
        self.check_length("the buffer for points", out.pixels().unwrap_or_default())
    }

    fn check_frame(&self, unit_mm: f64, context: &FrameContext<'_>) -> Result<(), CorrectorError> {
        if !(unit_mm.is_finite() && unit_mm > 0.0) {
            return Err(CorrectorError::Unit { unit_mm });
        }
        let image = context.amplitude;
        image.map_or(Ok(()), |i| self.check_size("the amplitude image", (i.width, i.height), i.data.len()))
    }
}

const NO_RAY: [f64; 2] = [f64::NAN; 2];
/// Largest deviation of the plan from the camera, mm; results are to be within 0.01 mm.
const PLAN_TOLERANCE_MM: f64 = 0.008;
/// Depth up to which that holds, mm.
const WORKING_RANGE_MM: f64 = 5000.0;

/// One pixel through the plan.
struct OnePixel<'a> {
    plan: &'a Plan,
    frame: &'a Frame<'a>,
    index: usize,
    z: &'a mut [f32; 1],
}

impl Kernel for OnePixel<'_> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.plan.correct(isa, self.frame, self.index, self.z);
    }
}

fn pixel(index: usize, width: usize) -> [f64; 2] {
    [(index % width) as f64, (index / width) as f64]
}

#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;
