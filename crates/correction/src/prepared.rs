//! A camera with everything of its correction that does not change from frame to frame.

use depthcal_model::{Camera, Context, Modulation};
use rayon::prelude::*;

use crate::conventions::{NO_RAY, TYPICAL_RHO, pixel};
use crate::depth_u16::Bounds;
use crate::error::CorrectorError;
use crate::frame_context::{AmplitudeImage, FrameContext};
use crate::light::{FrameLight, MeasuredDepth};
use crate::needs::Needs;
use crate::plan::{F32_ROUNDING, FrameInputs, Plan, classify, slants};
use crate::rays::{RayCubics, Rays};
use crate::simd::{Isa, Kernel, dispatch};

/// Largest deviation of a plan from the camera's own inverse at which it is used, mm. Results are to be within 0.01 mm.
const PLAN_TOLERANCE_MM: f64 = 0.008;
/// Depth up to which [`PLAN_TOLERANCE_MM`] holds, mm; beyond it the tolerance grows with the square of depth.
const WORKING_RANGE_MM: f64 = 5000.0;

/// A camera with everything of its correction that does not change from frame to frame.
#[derive(Debug, Clone)]
pub(crate) struct PreparedCamera {
    pub camera: Camera,
    pub needs: Needs,
    /// True ray (x, y) = (X/Z, Y/Z) of every pixel, NaN where there is none; for a lens that depends on depth, at a
    /// typical depth.
    pub rays: Vec<[f64; 2]>,
    /// x and y of the rays as two planes of f32.
    pub ray_planes: [Vec<f32>; 2],
    /// The rays as cubics along the rows.
    pub ray_cubics: RayCubics,
    /// Modulation frequencies of the effect that depends on the light of a frame; `None` without such an effect.
    pub modulation: Option<Modulation>,
    /// Range over depth at every pixel; empty without such an effect.
    pub slants: Vec<f32>,
    /// Whether every pixel has the same ray at every depth and in every frame.
    pub rays_are_fixed: bool,
    /// `None` where every pixel is inverted by the camera.
    pub plan: Option<Plan>,
    /// Bounds on the coefficients, where the plan is a single Möbius map.
    pub bounds: Option<Bounds>,
}

impl PreparedCamera {
    /// Computes the rays of all pixels and the tables of the camera's depth pieces.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Empty`] where the camera has no pixels, [`CorrectorError::NoRay`] where none of its pixels has
    /// a ray.
    pub fn new(camera: &Camera) -> Result<Self, CorrectorError> {
        let (width, height) = (camera.width, camera.height);
        if width == 0 || height == 0 {
            return Err(CorrectorError::Empty { width, height });
        }
        let mut planes = [vec![0.0; width * height], vec![0.0; width * height]];
        let [x, y] = &mut planes;
        Rays::new(camera).double([x, y])?;
        let rays: Vec<[f64; 2]> = planes[0].iter().zip(&planes[1]).map(|(x, y)| [*x, *y]).collect();
        let first = camera.ray(camera.image_pixel(&Context::default()), TYPICAL_RHO);
        if let (true, Err(source)) = (rays.iter().all(|r| r[0].is_nan()), first) {
            return Err(CorrectorError::NoRay { source });
        }
        let needs = classify::needs(camera);
        let rays_are_fixed = classify::rays_are_fixed(camera);
        let plan = if rays_are_fixed {
            Plan::of_pieces(camera, &rays)
        } else if needs == Needs::default() {
            Plan::of_chain(camera, &classify::samples(camera, &rays), |i| !rays[i][0].is_nan())
        } else {
            None
        };
        let mut ray_planes = [0, 1].map(|k| rays.iter().map(|ray| ray[k] as f32).collect());
        let ray_cubics = RayCubics::new(&rays, &mut ray_planes);
        let modulation = classify::modulation(camera).filter(|_| needs.stray_light);
        let slants = if modulation.is_some() { slants(&rays) } else { Vec::new() };
        let camera = camera.clone();
        let bounds = None;
        let mut prepared =
            Self { camera, needs, rays, ray_planes, ray_cubics, modulation, slants, rays_are_fixed, plan, bounds };
        prepared.plan = prepared.plan.take().and_then(|mut plan| {
            plan.error_mm = prepared.error_of(&plan)?;
            Some(plan)
        });
        let map = prepared.plan.as_ref().and_then(Plan::only_moebius);
        prepared.bounds = map.map(|map| Bounds::new(map, width * height));
        Ok(prepared)
    }

    /// The number of pixels.
    pub fn pixels(&self) -> usize {
        self.camera.width * self.camera.height
    }

    /// True ray of a pixel at a true inverse depth, 1/mm; NaN where there is none.
    pub fn ray(&self, index: usize, rho: f64) -> [f64; 2] {
        if self.rays_are_fixed {
            return self.rays[index];
        }
        let context = Context { pixel: pixel(index, self.camera.width), ..Context::default() };
        self.camera.ray(self.camera.image_pixel(&context), rho).unwrap_or(NO_RAY)
    }

    /// True depth of a measured one, mm, by the camera's own inverse in f64. `None` where the pixel has no ray or the
    /// model has no inverse.
    pub fn invert(&self, context: &Context, index: usize, measured_mm: f64, cosine: f64) -> Option<f64> {
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

    /// Amplitudes of a frame with which a plan is compared with the camera: dark and bright areas for an effect of the light of
    /// the whole frame, else the same at all pixels.
    fn some_amplitudes(&self) -> Vec<u16> {
        let width = self.camera.width;
        let bright = |i: usize| !self.needs.stray_light || (i % width / 32 + i / width / 32).is_multiple_of(2);
        (0..self.pixels()).map(|i| if bright(i) { 777 } else { 70 }).collect()
    }

    /// Largest deviation of a plan from the camera's own inverse, mm, less what the roundings of f32 explain; `None`
    /// beyond [`PLAN_TOLERANCE_MM`]. Pieces are classified one by one and at few depths only; this checks all of them
    /// together, at sampled pixels over the depths that cameras measure.
    fn error_of(&self, plan: &Plan) -> Option<f64> {
        let amplitudes = if self.needs.amplitude { self.some_amplitudes() } else { Vec::new() };
        let (width, height) = (self.camera.width, self.camera.height);
        let cosines = self.needs.incidence.then(|| vec![0.7; self.pixels()]);
        let amplitude = self.needs.amplitude.then_some(AmplitudeImage { width, height, data: &amplitudes });
        let quantities = classify::some_quantities(&self.camera);
        let context = FrameContext { time_s: 431.0, temperature_c: 37.5, quantities, amplitude };
        let depth_mm = vec![1234.0; if self.modulation.is_some() { self.pixels() } else { 0 }];
        let depth = MeasuredDepth::Millimetres(&depth_mm);
        let light = amplitude.zip(self.modulation).and_then(|(image, modulation)| {
            FrameLight::new(modulation, self.camera.width, &self.slants, image.data, depth)
        });
        let inputs = plan.inputs(&context, cosines.as_deref(), light.as_ref());
        let cosine = cosines.as_ref().map_or(1.0, |c| f64::from(c[0]));
        let samples = classify::samples(&self.camera, &self.rays);
        let of_sample = |(k, index): (usize, usize)| {
            let of_pixel = context.at(pixel(index, self.camera.width), index);
            let of_pixel =
                Context { stray: light.as_ref().map_or(of_pixel.stray, |light| light.at(index)), ..of_pixel };
            let errors = [280.0, 517.0, 911.0, 1493.0, 2711.0, 4523.0, 7919.0].map(|depth_mm| {
                // No two samples have the same depth.
                let measured = (depth_mm * (1.0 + 1e-4 * k as f64)) as f32;
                let mut z = [measured];
                dispatch(OnePixel { plan, inputs: &inputs, index, z: &mut z });
                if z[0].is_nan() {
                    return 0.0;
                }
                let expected = self.invert(&of_pixel, index, f64::from(measured), cosine);
                // Beyond the working range a model may magnify the roundings of f32.
                expected.map_or(f64::INFINITY, |e| {
                    let unexplained = ((f64::from(z[0]) - e).abs() - e * f64::from(F32_ROUNDING)).max(0.0);
                    unexplained / (e / WORKING_RANGE_MM).max(1.0).powi(2)
                })
            });
            errors.into_iter().fold(0.0, f64::max)
        };
        let error = samples.into_par_iter().enumerate().map(of_sample).reduce(|| 0.0, f64::max);
        (error < PLAN_TOLERANCE_MM).then_some(error)
    }
}

/// A single pixel through a plan.
pub(crate) struct OnePixel<'a> {
    pub plan: &'a Plan,
    pub inputs: &'a FrameInputs<'a>,
    /// Row-major index of the pixel.
    pub index: usize,
    /// Measured depth, mm, which becomes the true one; NaN where the stages do not reach.
    pub z: &'a mut [f32; 1],
}

impl Kernel for OnePixel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.plan.correct(isa, self.inputs, self.index, self.z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::block;

    fn prepared(dw: f64) -> PreparedCamera {
        let depth = block("projective", &[1e-4, -3e-6, -7e-6, dw]);
        PreparedCamera::new(&Camera::new(64, 48, [60.0, 60.0, 31.0, 24.0, 0.0], vec![depth])).unwrap()
    }

    /// The plan of another camera is off by a share of depth that is known.
    #[test]
    fn a_plan_that_is_off_is_refused() {
        let camera = prepared(1.006);
        let error_mm = camera.error_of(camera.plan.as_ref().unwrap()).unwrap();
        assert!(error_mm < 0.001, "{error_mm} mm");
        let other = |share: f64| camera.error_of(prepared(1.006 * (1.0 + share)).plan.as_ref().unwrap());
        // A share of 1e-6, less 2.5e-7 that f32 explains, is 0.004 mm at 5 m; further away more is tolerated than it grows.
        let error_mm = other(1e-6).unwrap();
        assert!(error_mm > 0.001 && error_mm < 0.006, "{error_mm} mm");
        assert_eq!(other(1e-5), None);
    }
}
