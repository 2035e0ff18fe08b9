//! Correction of depth images with a calibrated camera: built once, then applied to every frame.
//!
//! A [`Corrector`] keeps what does not change from frame to frame. The true ray of a pixel is one of those things unless
//! the lens breathes; where all depth pieces are affine in inverse depth, a frame costs one multiplication and
//! one division per pixel, else every pixel is inverted by [`Camera`]. Corrected depth stays at the pixels of the depth
//! image: pieces at the hook `pixel` decide which ray a depth pixel has, nothing is moved.
//!
//! Invalid depth (0, for f32 also what is negative or not finite) stays invalid (0). Pixels that see no ray, or whose
//! depth the model cannot invert, become invalid and are counted. Results saturate at the ends of their type.

mod incidence;
mod probe;
mod table;

use std::ops::{Add, AddAssign};

use depthcal_io::{DepthImage, GrayImage};
use depthcal_model::{Camera, CameraError, Context};
use rayon::prelude::*;
use thiserror::Error;

pub use probe::Needs;
use table::Affine;

/// Why depth cannot be corrected.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CorrectorError {
    /// The camera has no pixels.
    #[error("the camera's image has {width} × {height} px: give the size of its images")]
    Empty {
        /// Width of the image, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// No pixel has a ray.
    #[error("no pixel of the camera has a ray, so its pinhole or lens is not usable: {source}; calibrate again")]
    NoRay {
        /// What is wrong at the first pixel.
        source: CameraError,
    },
    /// An image has another size than the camera.
    #[error(
        "{what} has {}×{} px, but the calibration is for {}×{} px: give images of the calibrated resolution",
        found.0, found.1, expected.0, expected.1
    )]
    Size {
        /// Which image.
        what: &'static str,
        /// Its width and height, px.
        found: (usize, usize),
        /// Width and height of the camera, px.
        expected: (usize, usize),
    },
    /// A buffer does not hold one value per pixel.
    #[error("{what} has {found} values, but the camera has {expected} pixels")]
    Length {
        /// Which buffer.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The number of pixels.
        expected: usize,
    },
    /// The depth unit is not a length.
    #[error("the depth unit is {unit_mm} mm per step: give a number above 0")]
    Unit {
        /// The unit, mm per step.
        unit_mm: f64,
    },
}

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
        Context { pixel, amplitude, time_s: self.time_s, temperature_c: self.temperature_c, ..Context::default() }
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
    /// True ray of every pixel, NaN where there is none; `None` where it depends on the depth or on the frame.
    rays: Option<Vec<[f64; 2]>>,
    affine: Option<Affine>,
}

impl Corrector {
    /// Prepares the correction for a camera: rays of all pixels, and the table of the fast path where there is one.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Empty`], and [`CorrectorError::NoRay`] where the camera maps no pixel to a ray.
    pub fn new(camera: &Camera) -> Result<Self, CorrectorError> {
        let (width, height) = (camera.width, camera.height);
        if width == 0 || height == 0 {
            return Err(CorrectorError::Empty { width, height });
        }
        let ray = |index: usize| {
            let context = Context { pixel: pixel(index, width), ..Context::default() };
            camera.ray(camera.image_pixel(&context), probe::TYPICAL_RHO)
        };
        let rays: Vec<[f64; 2]> = (0..width * height).into_par_iter().map(|i| ray(i).unwrap_or(NO_RAY)).collect();
        if let (true, Err(source)) = (rays.iter().all(|r| r[0].is_nan()), ray(0)) {
            return Err(CorrectorError::NoRay { source });
        }
        let needs = probe::needs(camera);
        let rays = probe::rays_are_fixed(camera).then_some(rays);
        let affine = rays.as_ref().and_then(|rays| Affine::new(camera, rays));
        Ok(Self { camera: camera.clone(), needs, rays, affine })
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

    /// Corrects a depth image of `unit_mm` per step into `out`, whose unit is the same. Results are rounded; they end at
    /// 1 and 65535, so that valid depth never becomes invalid by rounding and never wraps.
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
        check_unit(unit_mm)?;
        self.check_amplitude(context)?;
        let read = |raw: u16| f64::from(raw) * unit_mm;
        let write = |depth_mm: f64| {
            let steps = (depth_mm / unit_mm).round();
            let held = steps.clamp(1.0, f64::from(u16::MAX));
            (held as u16, held != steps)
        };
        Ok(self.run(&depth.data, read, context, &mut out.data, write))
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
        self.check_amplitude(context)?;
        let write = |depth_mm: f64| {
            let held = depth_mm.clamp(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX));
            (held as f32, held != depth_mm)
        };
        Ok(self.run(depth_mm, f64::from, context, out_mm, write))
    }

    /// The points of a corrected depth image of `unit_mm` per step: one per pixel, row-major, [x, y, z] in mm in the
    /// camera frame; NaN where there is no depth or no ray.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Size`], [`CorrectorError::Length`], [`CorrectorError::Unit`].
    pub fn points(&self, corrected: &DepthImage, unit_mm: f64) -> Result<Vec<[f32; 3]>, CorrectorError> {
        self.check_size("the depth image", (corrected.width, corrected.height), corrected.data.len())?;
        check_unit(unit_mm)?;
        Ok(self.back_project(&corrected.data, |raw| f64::from(raw) * unit_mm))
    }

    /// The same for corrected depth in mm, as [`Corrector::correct_f32`] gives it.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`].
    pub fn points_f32(&self, corrected_mm: &[f32]) -> Result<Vec<[f32; 3]>, CorrectorError> {
        self.check_length("the depth", corrected_mm.len())?;
        Ok(self.back_project(corrected_mm, f64::from))
    }

    fn back_project<T: Copy + Sync>(&self, depth: &[T], read: impl Fn(T) -> f64 + Sync) -> Vec<[f32; 3]> {
        let point = |(index, raw): (usize, &T)| {
            let z = read(*raw);
            let ray = if valid(z) { self.ray(index, 1.0 / z) } else { NO_RAY };
            if ray[0].is_nan() { [f32::NAN; 3] } else { [(ray[0] * z) as f32, (ray[1] * z) as f32, z as f32] }
        };
        depth.par_iter().enumerate().with_min_len(self.camera.width).map(point).collect()
    }

    /// True ray of a pixel at a true inverse depth, 1/mm; NaN where there is none.
    fn ray(&self, index: usize, rho: f64) -> [f64; 2] {
        match &self.rays {
            Some(rays) => rays[index],
            None => {
                let context = Context { pixel: pixel(index, self.camera.width), ..Context::default() };
                self.camera.ray(self.camera.image_pixel(&context), rho).unwrap_or(NO_RAY)
            }
        }
    }

    fn run<I: Copy + Sync, O: Copy + Default + Send>(
        &self,
        depth: &[I],
        read: impl Fn(I) -> f64 + Sync,
        context: &FrameContext<'_>,
        out: &mut [O],
        write: impl Fn(f64) -> (O, bool) + Sync,
    ) -> CorrectionSummary {
        if let Some(affine) = &self.affine {
            return self.rows(depth, &read, out, &write, |index, measured_mm| affine.correct(index, measured_mm));
        }
        let invert = |index: usize, measured_mm: f64, cosine: f64| {
            let context = context.at(pixel(index, self.camera.width), index);
            self.invert(&context, index, measured_mm, cosine)
        };
        if !self.needs.incidence {
            return self.rows(depth, &read, out, &write, |index, measured_mm| invert(index, measured_mm, 1.0));
        }
        // The angle comes from the surface, the surface from a correction at a right angle, which is near enough: what
        // the angle changes in depth hardly changes the surface's slope.
        let mut first = vec![0.0f32; depth.len()];
        self.rows(depth, &read, &mut first, &|z| (z as f32, false), |index, z| invert(index, z, 1.0));
        let cosines = incidence::cosines(self.camera.width, &first, |index, rho| self.ray(index, rho));
        self.rows(depth, &read, out, &write, |index, z| invert(index, z, f64::from(cosines[index])))
    }

    /// Calls `correct` with index and measured depth (mm) of every valid pixel, rows in parallel.
    fn rows<I: Copy + Sync, O: Copy + Default + Send>(
        &self,
        depth: &[I],
        read: &(impl Fn(I) -> f64 + Sync),
        out: &mut [O],
        write: &(impl Fn(f64) -> (O, bool) + Sync),
        correct: impl Fn(usize, f64) -> Option<f64> + Sync,
    ) -> CorrectionSummary {
        let width = self.camera.width;
        let row = |(row, (input, output)): (usize, (&[I], &mut [O]))| {
            let mut summary = CorrectionSummary::default();
            for (column, (raw, result)) in input.iter().zip(output).enumerate() {
                *result = O::default();
                let measured_mm = read(*raw);
                if !valid(measured_mm) {
                    summary.invalid += 1;
                } else if let Some(depth_mm) = correct(row * width + column, measured_mm) {
                    let (value, saturated) = write(depth_mm);
                    *result = value;
                    summary.corrected += 1;
                    summary.saturated += usize::from(saturated);
                } else {
                    summary.not_correctable += 1;
                }
            }
            summary
        };
        depth
            .par_chunks(width)
            .zip(out.par_chunks_mut(width))
            .enumerate()
            .map(row)
            .reduce(CorrectionSummary::default, Add::add)
    }

    /// True depth of a measured one (mm) by the camera's inverse.
    fn invert(&self, context: &Context, index: usize, measured_mm: f64, cosine: f64) -> Option<f64> {
        let measured = 1.0 / measured_mm;
        let rho = match &self.rays {
            Some(rays) if rays[index][0].is_nan() => return None,
            Some(rays) => self.camera.true_inverse_depth(context, rays[index], cosine, measured).ok()?,
            None => self.camera.correct(context, cosine, measured).ok()?.1,
        };
        Some(1.0 / rho)
    }

    fn check_size(&self, what: &'static str, found: (usize, usize), length: usize) -> Result<(), CorrectorError> {
        let expected = (self.camera.width, self.camera.height);
        if found != expected {
            return Err(CorrectorError::Size { what, found, expected });
        }
        self.check_length(what, length)
    }

    fn check_length(&self, what: &'static str, found: usize) -> Result<(), CorrectorError> {
        let expected = self.camera.width * self.camera.height;
        if found == expected { Ok(()) } else { Err(CorrectorError::Length { what, found, expected }) }
    }

    fn check_amplitude(&self, context: &FrameContext<'_>) -> Result<(), CorrectorError> {
        let image = context.amplitude;
        image.map_or(Ok(()), |i| self.check_size("the amplitude image", (i.width, i.height), i.data.len()))
    }
}

const NO_RAY: [f64; 2] = [f64::NAN; 2];

fn check_unit(unit_mm: f64) -> Result<(), CorrectorError> {
    if unit_mm.is_finite() && unit_mm > 0.0 { Ok(()) } else { Err(CorrectorError::Unit { unit_mm }) }
}

fn valid(depth_mm: f64) -> bool {
    depth_mm > 0.0 && depth_mm.is_finite()
}

fn pixel(index: usize, width: usize) -> [f64; 2] {
    [(index % width) as f64, (index / width) as f64]
}

#[cfg(test)]
mod tests;
