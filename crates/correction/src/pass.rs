//! One pass over a frame: load, stages, exact inverse where they do not reach, store.

use super::bands::{CHUNK, STRETCH, Split, for_bands};
use super::formats::{ROUND, count_f32, load, store_f32, store_u16};
use super::plan::{Frame, Plan};
use super::points::{FromSteps, PointsMut, back_project};
use super::simd::{Isa, Kernel, dispatch};
use super::steps::{self, MOST_ERROR};
use super::{CorrectionSummary, Corrector, FrameContext, incidence, pixel};

/// Where measured depth comes from.
#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    U16(&'a [u16]),
    F32(&'a [f32]),
    /// The place where the results go.
    Output,
}

/// Where corrected depth goes.
pub(super) enum Output<'a> {
    U16(&'a mut [u16]),
    F32(&'a mut [f32]),
    Points(PointsMut<'a>),
}

impl Split for Output<'_> {
    fn split(self, pixels: usize) -> (Self, Self) {
        match self {
            Self::U16(out) => {
                let (a, b) = out.split(pixels);
                (Self::U16(a), Self::U16(b))
            }
            Self::F32(out) => {
                let (a, b) = out.split(pixels);
                (Self::F32(a), Self::F32(b))
            }
            Self::Points(out) => {
                let (a, b) = out.split(pixels);
                (Self::Points(a), Self::Points(b))
            }
        }
    }
}

impl Corrector {
    /// Corrects `input` of `unit_mm` per step into `output`, of the same unit where it has steps.
    pub(super) fn run(
        &self,
        input: Input<'_>,
        unit_mm: f64,
        context: &FrameContext<'_>,
        output: Output<'_>,
    ) -> CorrectionSummary {
        if !self.needs.incidence {
            return self.run_with(input, unit_mm, context, None, output);
        }
        // The angle comes from the surface, the surface from a correction at a right angle, which is near enough: what
        // the angle changes in depth hardly changes the surface's slope.
        let mut first = vec![0.0f32; self.pixels()];
        let measured = match (input, &output) {
            (Input::Output, Output::U16(depth)) => Input::U16(depth),
            (Input::Output, Output::F32(depth)) => Input::F32(depth),
            (input, _) => input,
        };
        self.run_with(measured, unit_mm, context, None, Output::F32(&mut first));
        let cosines = incidence::cosines(self.camera.width, &first, |index, rho| self.ray(index, rho));
        self.run_with(input, unit_mm, context, Some(&cosines), output)
    }

    fn run_with(
        &self,
        input: Input<'_>,
        unit_mm: f64,
        context: &FrameContext<'_>,
        cosines: Option<&[f32]>,
        output: Output<'_>,
    ) -> CorrectionSummary {
        let frame = self.plan.as_ref().map(|plan| (plan, plan.frame(context, cosines)));
        let of_frame = OfFrame { corrector: self, context, cosines, frame: frame.as_ref(), unit_mm };
        for_bands(self.pixels(), output, &|first, count, output| {
            dispatch(Band { of_frame, input, output, first, count })
        })
    }

    /// The points of corrected depth.
    pub(super) fn back_project(&self, input: Input<'_>, unit_mm: f64, out: PointsMut<'_>) {
        for_bands(self.pixels(), out, &|first, count, out| {
            dispatch(BackProject { corrector: self, input, unit_mm: unit_mm as f32, out, first, count });
            CorrectionSummary::default()
        });
    }
}

/// What all bands of a frame share.
#[derive(Clone, Copy)]
struct OfFrame<'a> {
    corrector: &'a Corrector,
    context: &'a FrameContext<'a>,
    cosines: Option<&'a [f32]>,
    frame: Option<&'a (&'a Plan, Frame<'a>)>,
    unit_mm: f64,
}

impl OfFrame<'_> {
    /// True depth (mm) by the camera's own inverse.
    #[inline(never)]
    fn exact(&self, index: usize, measured_mm: f64) -> Option<f64> {
        let context = self.context.at(pixel(index, self.corrector.camera.width), index);
        let cosine = self.cosines.map_or(1.0, |cosines| f64::from(cosines[index]));
        self.corrector.invert(&context, index, measured_mm, cosine)
    }

    /// The same in steps, rounded, and whether it was beyond the ends.
    #[inline(never)]
    fn exact_steps(&self, index: usize, steps: u16) -> (u16, bool) {
        let Some(depth_mm) = self.exact(index, f64::from(steps) * self.unit_mm) else { return (0, false) };
        let rounded = (depth_mm / self.unit_mm).round();
        let held = rounded.clamp(1.0, f64::from(u16::MAX));
        (held as u16, held != rounded)
    }

    /// Largest error of the plan in steps. Twice what was found by sampling it.
    #[inline(always)]
    fn error_steps(&self) -> f32 {
        self.frame.map_or(0.0, |(plan, _)| (2.0 * plan.error_mm / self.unit_mm) as f32)
    }

    /// True depth (mm) from one that is right to a thousandth: two steps of Newton's method in f64.
    #[inline(never)]
    fn polished(&self, index: usize, measured_mm: f64, near_mm: f64) -> f64 {
        let corrector = self.corrector;
        let context = self.context.at(pixel(index, corrector.camera.width), index);
        let cosine = self.cosines.map_or(1.0, |cosines| f64::from(cosines[index]));
        let ray = corrector.rays[index];
        let measured = |rho: f64| corrector.camera.measured_inverse_depth(&context, ray, cosine, rho);
        let mut rho = 1.0 / near_mm;
        for _ in 0..2 {
            let (here, beside) = (measured(rho), measured(rho * (1.0 + 1e-5)));
            rho += (1.0 / measured_mm - here) * (rho * 1e-5) / (beside - here);
        }
        1.0 / rho
    }

    /// Rounds again what lies so near the middle between two steps that f32 cannot tell the side.
    #[inline(never)]
    fn settle(&self, first: usize, measured: &[u16], z: &[f32], distances: &[f32], out: &mut [u16]) {
        for (i, out) in out.iter_mut().enumerate().filter(|(i, out)| distances[*i] <= 0.0 && **out > 0) {
            let measured_mm = f64::from(measured[i]) * self.unit_mm;
            let depth_mm = if self.corrector.rays_are_fixed {
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

    /// Fills in what the stages did not know; NaN becomes 0 where there is no true depth.
    #[inline(never)]
    fn fill_in(&self, first: usize, measured_mm: impl Fn(usize) -> f64, z: &mut [f32]) {
        for (i, z) in z.iter_mut().enumerate().filter(|(_, z)| z.is_nan()) {
            *z = self.exact(first + i, measured_mm(i)).map_or(0.0, |depth_mm| {
                // A depth that f32 cannot hold is a depth still.
                (depth_mm as f32).max(f32::MIN_POSITIVE)
            });
        }
    }
}

/// What the roundings of f32 on the way through the stages may add up to, as a share of depth.
pub(super) const OF_F32: f32 = 2.5e-7;

/// Distance of depths in steps from the middle between two steps, less what they may be off, into `distances`; whether any is 0
/// or below. What is off by less than [`MOST_ERROR`] is right as it is.
#[inline(always)]
fn from_half(measured: &[u16], z: &[f32], per_mm: f32, error_steps: f32, distances: &mut [f32]) -> bool {
    let mut undecided = 0u32;
    for ((raw, z), distance) in measured.iter().zip(z).zip(distances) {
        let steps = *z * per_mm;
        let missing = (steps - ((steps + ROUND) - ROUND)).abs();
        // A change is off by a share of itself, however little it leaves.
        let change = (steps - f32::from(*raw)).abs();
        let error = error_steps + steps * OF_F32 + change * (2.0 * OF_F32);
        *distance = if error > MOST_ERROR { (0.5 - missing) - error } else { 1.0 };
        undecided += u32::from(*distance <= 0.0);
    }
    undecided > 0
}

fn kept<T: Copy + Default>(values: &[T]) -> [T; CHUNK] {
    let mut kept = [T::default(); CHUNK];
    kept[..values.len()].copy_from_slice(values);
    kept
}

/// A band of neighbouring pixels.
struct Band<'a> {
    of_frame: OfFrame<'a>,
    input: Input<'a>,
    output: Output<'a>,
    first: usize,
    count: usize,
}

impl Kernel for Band<'_> {
    type Output = CorrectionSummary;

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> CorrectionSummary {
        let mut summary = CorrectionSummary::default();
        let (mut offset, mut by_chunks) = (0, 0);
        while offset < self.count {
            let most = if offset < by_chunks { CHUNK } else { STRETCH };
            let count = most.min(self.count - offset);
            if self.part(isa, offset, count, &mut summary) {
                offset += count;
            } else {
                by_chunks = offset + count;
            }
        }
        summary
    }
}

impl Band<'_> {
    /// Corrects some pixels; whether it has: what takes several stages or f64 needs them in parts of no more than [`CHUNK`].
    #[inline(always)]
    fn part<I: Isa>(&mut self, isa: I, offset: usize, count: usize, summary: &mut CorrectionSummary) -> bool {
        let Self { of_frame, input, output, .. } = self;
        let (first, own) = (self.first + offset, offset..offset + count);
        let pixels = first..first + count;
        let corrector = of_frame.corrector;
        if count > CHUNK && matches!(input, Input::Output) {
            return false;
        }
        // What is to be overwritten is kept.
        let (steps, millimetres): ([u16; CHUNK], [f32; CHUNK]);
        let input = match (&*input, &*output) {
            (Input::Output, Output::U16(out)) => {
                steps = kept(&out[own.clone()]);
                Input::U16(&steps[..count])
            }
            (Input::Output, Output::F32(out)) => {
                millimetres = kept(&out[own.clone()]);
                Input::F32(&millimetres[..count])
            }
            (Input::U16(all), _) => Input::U16(&all[pixels.clone()]),
            (Input::F32(all), _) => Input::F32(&all[pixels.clone()]),
            (Input::Output, Output::Points(_)) => return true,
        };

        let map = of_frame.frame.and_then(|(plan, _)| plan.only_moebius()).zip(corrector.bounds.as_ref());
        if let (Input::U16(measured), Output::U16(out), Some(map)) = (input, &mut *output, map) {
            let (c, unit_mm) = (map.0.slices(first, count), of_frame.unit_mm);
            let chunk = steps::Chunk { c, unit_mm, measured, out: &mut out[own.clone()] };
            if let Some(done) = steps::correct(isa, map, first, chunk, &|i, raw| of_frame.exact_steps(i, raw)) {
                summary.corrected += done.corrected;
                summary.saturated += done.saturated;
                summary.invalid += count - done.depths;
                summary.not_correctable += done.depths - done.corrected;
                return true;
            }
        }

        let rays = [0, 1].map(|k| &corrector.ray_planes[k][pixels.clone()]);
        let map = of_frame.frame.and_then(|(plan, _)| plan.map_on_rays());
        if let (Input::U16(measured), Output::Points(PointsMut::Interleaved(out)), Some(map)) =
            (input, &mut *output, map)
        {
            let (out, unit_mm) = (&mut out[3 * offset..3 * (offset + count)], of_frame.unit_mm as f32);
            let cubics = corrector.ray_cubics.part(first, count);
            if let Some(found) = isa.points::<true>(FromSteps { map, measured, unit_mm, rays, cubics, out }) {
                summary.corrected += found.points;
                summary.invalid += count - found.depths;
                summary.not_correctable += found.depths - found.points;
                return true;
            }
        }
        if count > CHUNK {
            return false;
        }

        let mut z = [0.0f32; CHUNK];
        let z = &mut z[..count];
        match input {
            Input::U16(measured) => load(measured, of_frame.unit_mm as f32, z),
            Input::F32(measured) => load(measured, 1.0, z),
            Input::Output => {}
        }
        let (depths, _) = count_f32(z);
        match (of_frame.frame, &*output) {
            (Some((plan, frame)), Output::Points(_)) => plan.correct_on_rays(isa, frame, first, rays, z),
            (Some((plan, frame)), _) => plan.correct(isa, frame, first, z),
            (None, _) => z.iter_mut().for_each(|z| *z = if *z > 0.0 { f32::NAN } else { *z }),
        }
        let (mut corrected, nans) = count_f32(z);
        if nans > 0 {
            let measured_mm = |i: usize| match input {
                Input::U16(measured) => f64::from(measured[i]) * of_frame.unit_mm,
                Input::F32(measured) => f64::from(measured[i]),
                Input::Output => f64::NAN,
            };
            of_frame.fill_in(first, measured_mm, z);
            corrected = count_f32(z).0;
        }
        summary.corrected += corrected;
        summary.invalid += count - depths;
        summary.not_correctable += depths - corrected;
        summary.saturated += match output {
            Output::U16(out) => {
                let per_mm = (1.0 / of_frame.unit_mm) as f32;
                let out = &mut out[own];
                let beyond = store_u16(isa, z, per_mm, out);
                let mut distances = [0.0f32; CHUNK];
                if let Input::U16(measured) = input
                    && from_half(measured, z, per_mm, of_frame.error_steps(), &mut distances[..count])
                {
                    of_frame.settle(first, measured, z, &distances[..count], out);
                }
                beyond
            }
            Output::F32(out) => store_f32(z, &mut out[own]),
            Output::Points(out) => {
                points(isa, corrector, first, z, out.part(offset, count));
                0
            }
        };
        true
    }
}

/// A band of points.
struct BackProject<'a> {
    corrector: &'a Corrector,
    input: Input<'a>,
    unit_mm: f32,
    out: PointsMut<'a>,
    first: usize,
    count: usize,
}

impl Kernel for BackProject<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        if let (Input::U16(depth), PointsMut::Interleaved(out), true) =
            (self.input, &mut self.out, self.corrector.rays_are_fixed)
        {
            for (k, out) in out[..3 * self.count].chunks_mut(3 * STRETCH).enumerate() {
                let (first, count) = (self.first + k * STRETCH, out.len() / 3);
                let (pixels, unit_mm) = (first..first + count, self.unit_mm);
                let rays = [0, 1].map(|k| &self.corrector.ray_planes[k][pixels.clone()]);
                let (map, cubics) = ((0.0, [0.0; 3]), self.corrector.ray_cubics.part(first, count));
                isa.points::<false>(FromSteps { map, measured: &depth[pixels], unit_mm, rays, cubics, out });
            }
            return;
        }
        for offset in (0..self.count).step_by(CHUNK) {
            let count = CHUNK.min(self.count - offset);
            let first = self.first + offset;
            let mut z = [0.0f32; CHUNK];
            let z = &mut z[..count];
            match self.input {
                Input::U16(depth) => load(&depth[first..first + count], self.unit_mm, z),
                Input::F32(depth) => load(&depth[first..first + count], self.unit_mm, z),
                Input::Output => {}
            }
            points(isa, self.corrector, first, z, self.out.part(offset, count));
        }
    }
}

/// Points of neighbouring pixels from `first` on.
#[inline(always)]
fn points<I: Isa>(isa: I, corrector: &Corrector, first: usize, z: &[f32], out: PointsMut<'_>) {
    if corrector.rays_are_fixed {
        let rays = [0, 1].map(|k| &corrector.ray_planes[k][first..first + z.len()]);
        back_project(isa, z, rays, out);
    } else {
        points_on_moving_rays(corrector, first, z, out);
    }
}

/// [`points`] where the ray depends on the depth.
#[inline(never)]
fn points_on_moving_rays(corrector: &Corrector, first: usize, z: &[f32], mut out: PointsMut<'_>) {
    for (i, z) in z.iter().enumerate() {
        let depth = f64::from(*z);
        let ray = if depth > 0.0 { corrector.ray(first + i, 1.0 / depth) } else { super::NO_RAY };
        let point =
            if ray[0].is_nan() { [f32::NAN; 3] } else { [(ray[0] * depth) as f32, (ray[1] * depth) as f32, *z] };
        match &mut out {
            PointsMut::Interleaved(out) => out[3 * i..3 * i + 3].copy_from_slice(&point),
            PointsMut::Planes(planes) => (0..3).for_each(|k| planes[k][i] = point[k]),
        }
    }
}
