//! The frame that is being corrected, and the inverse of its pixels in f64.

use depthcal_model::Context;
use depthcal_model::frame_covariates::mean_and_slope;

use crate::conventions::pixel;
use crate::frame_context::FrameContext;
use crate::light::FrameLight;
use crate::plan::{FrameInputs, Plan};
use crate::prepared::PreparedCamera;

/// The frame that is being corrected, as all bands see it.
#[derive(Clone, Copy)]
pub(crate) struct CurrentFrame<'a> {
    pub prepared: &'a PreparedCamera,
    pub context: &'a FrameContext<'a>,
    /// Cosines of the angle of incidence, one per pixel; 1 where they are not given.
    pub cosines: Option<&'a [f32]>,
    /// The light of the frame, where an effect depends on it and it is known.
    pub light: Option<&'a FrameLight>,
    /// The plan and what it needs of this frame.
    pub plan: Option<&'a (&'a Plan, FrameInputs<'a>)>,
    pub unit_mm: f64,
}

impl CurrentFrame<'_> {
    /// The model's context at a pixel.
    fn context(&self, index: usize) -> Context {
        let (width, height) = (self.prepared.camera.width, self.prepared.camera.height);
        let mut context = self.context.at(pixel(index, width), index);
        if let (true, Some(image)) = (self.prepared.needs.surroundings, self.context.amplitude) {
            let of_pixel = mean_and_slope(image.data, [width, height], [index % width, index / width]);
            (context.surround, context.slope) = of_pixel;
        }
        match self.light {
            Some(light) => Context { stray: light.at(index), ..context },
            None => context,
        }
    }

    /// True depth of a measured one, mm, by the camera's own inverse; `None` where there is none.
    #[inline(never)]
    pub fn exact(&self, index: usize, measured_mm: f64) -> Option<f64> {
        let context = self.context(index);
        let cosine = self.cosines.map_or(1.0, |cosines| f64::from(cosines[index]));
        self.prepared.invert(&context, index, measured_mm, cosine)
    }

    /// [`CurrentFrame::exact`] in steps, rounded and limited to 1 … 65535, and whether it was beyond these limits; 0
    /// where there is no true depth.
    #[inline(never)]
    pub fn exact_steps(&self, index: usize, steps: u16) -> (u16, bool) {
        let Some(depth_mm) = self.exact(index, f64::from(steps) * self.unit_mm) else { return (0, false) };
        let rounded = (depth_mm / self.unit_mm).round();
        let limited = rounded.clamp(1.0, f64::from(u16::MAX));
        (limited as u16, limited != rounded)
    }

    /// Bound on the error of the plan, steps: twice the largest error at sampled pixels.
    #[inline(always)]
    pub fn error_steps(&self) -> f32 {
        self.plan.map_or(0.0, |(plan, _)| (2.0 * plan.error_mm / self.unit_mm) as f32)
    }

    /// True depth of a measured one, mm, by two steps of Newton's method in f64 from one that is right to a thousandth.
    #[inline(never)]
    fn polished(&self, index: usize, measured_mm: f64, near_mm: f64) -> f64 {
        let prepared = self.prepared;
        let context = self.context(index);
        let cosine = self.cosines.map_or(1.0, |cosines| f64::from(cosines[index]));
        let ray = prepared.rays[index];
        let measured = |rho: f64| prepared.camera.measured_inverse_depth(&context, ray, cosine, rho);
        let mut rho = 1.0 / near_mm;
        for _ in 0..2 {
            let (here, nearby) = (measured(rho), measured(rho * (1.0 + 1e-5)));
            rho += (1.0 / measured_mm - here) * (rho * 1e-5) / (nearby - here);
        }
        1.0 / rho
    }

    /// Rounds again, from depth in f64, those results that lie so near the middle between two steps that the error of
    /// f32 may have rounded them to the wrong one: those with a distance of 0 or less (see `near_half`).
    #[inline(never)]
    pub fn round_again(&self, first: usize, measured: &[u16], z: &[f32], distances: &[f32], out: &mut [u16]) {
        for (i, out) in out.iter_mut().enumerate().filter(|(i, out)| distances[*i] <= 0.0 && **out > 0) {
            let measured_mm = f64::from(measured[i]) * self.unit_mm;
            let depth_mm = if self.prepared.rays_are_fixed {
                self.polished(first + i, measured_mm, f64::from(z[i]))
            } else {
                self.exact(first + i, measured_mm).unwrap_or(f64::NAN)
            };
            let steps = (depth_mm / self.unit_mm).round();
            if (steps - f64::from(*out)).abs() <= 1.0 {
                *out = steps.clamp(1.0, f64::from(u16::MAX)) as u16;
            }
        }
    }

    /// Replaces NaN, where the stages did not reach, by true depth in f64, or by 0 where there is none.
    #[inline(never)]
    pub fn fill_in(&self, first: usize, measured_mm: impl Fn(usize) -> f64, z: &mut [f32]) {
        for (i, z) in z.iter_mut().enumerate().filter(|(_, z)| z.is_nan()) {
            *z = self.exact(first + i, measured_mm(i)).map_or(0.0, |depth_mm| {
                // A depth too small for f32 must not become 0, which is invalid.
                (depth_mm as f32).max(f32::MIN_POSITIVE)
            });
        }
    }
}
