//! Correction of a band of pixels.

use super::buffers::{Input, Output};
use super::current_frame::CurrentFrame;
use super::formats::{ROUND, load, store_f32, store_u16};
use super::store_points::store_points;
use crate::bands::{CHUNK, STRETCH};
use crate::depth_u16::{self, Chunk, MOST_ERROR};
use crate::plan::F32_ROUNDING;
use crate::points::{DepthOnRays, PointsMut, from_u16};
use crate::simd::{Isa, Kernel, count_f32, measurement};
use crate::summary::CorrectionSummary;

/// A copy of at most [`CHUNK`] values, filled up with zeros.
fn copied<T: Copy + Default>(values: &[T]) -> [T; CHUNK] {
    let mut copy = [T::default(); CHUNK];
    copy[..values.len()].copy_from_slice(values);
    copy
}

/// A band of consecutive pixels to be corrected.
pub(crate) struct Band<'a> {
    pub frame: CurrentFrame<'a>,
    /// Depth of the whole frame.
    pub input: Input<'a>,
    /// Results of the band.
    pub output: Output<'a>,
    /// The first pixel.
    pub first: usize,
    /// The number of pixels.
    pub count: usize,
}

impl Kernel for Band<'_> {
    type Output = CorrectionSummary;

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> CorrectionSummary {
        let mut summary = CorrectionSummary::default();
        // Pixels before `by_chunks` are corrected chunk by chunk.
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
    /// Corrects `count` pixels from `offset` on and adds to the summary. Returns false, without results, where the
    /// pixels must be taken in parts of at most [`CHUNK`]: where there are several stages, or f64 is needed.
    #[inline(always)]
    fn part<I: Isa>(&mut self, isa: I, offset: usize, count: usize, summary: &mut CorrectionSummary) -> bool {
        let Self { frame, input, output, .. } = self;
        let (first, in_band) = (self.first + offset, offset..offset + count);
        let pixels = first..first + count;
        let prepared = frame.prepared;
        if count > CHUNK && matches!(input, Input::Output) {
            return false;
        }
        // Depth that the results overwrite is copied.
        let (steps, millimetres): ([u16; CHUNK], [f32; CHUNK]);
        let input = match (&*input, &*output) {
            (Input::Output, Output::U16(out)) => {
                steps = copied(&out[in_band.clone()]);
                Input::U16(&steps[..count])
            }
            (Input::Output, Output::F32(out)) => {
                millimetres = copied(&out[in_band.clone()]);
                Input::F32(&millimetres[..count])
            }
            (Input::U16(all), _) => Input::U16(&all[pixels.clone()]),
            (Input::F32(all), _) => Input::F32(&all[pixels.clone()]),
            (Input::Output, Output::Points(_)) => return true,
        };

        let map = frame.plan.and_then(|(plan, _)| plan.only_moebius()).zip(prepared.bounds.as_ref());
        if let (Input::U16(measured), Output::U16(out), Some(map)) = (input, &mut *output, map) {
            let (c, unit_mm) = (map.0.coefficients(first, count), frame.unit_mm);
            let chunk = Chunk { c, unit_mm, measured, out: &mut out[in_band.clone()] };
            if let Some(done) = depth_u16::correct(isa, map, first, chunk, &|i, raw| frame.exact_steps(i, raw)) {
                summary.corrected += done.corrected;
                summary.saturated += done.saturated;
                summary.invalid += count - done.depths;
                summary.not_correctable += done.depths - done.corrected;
                return true;
            }
        }

        let rays = [0, 1].map(|k| &prepared.ray_planes[k][pixels.clone()]);
        let map = frame.plan.and_then(|(plan, _)| plan.map_on_rays());
        if let (Input::U16(measured), Output::Points(PointsMut::Interleaved(out)), Some(map)) =
            (input, &mut *output, map)
        {
            let (out, unit_mm) = (&mut out[3 * offset..3 * (offset + count)], frame.unit_mm as f32);
            let cubics = prepared.ray_cubics.part(first, count);
            let pixels = DepthOnRays { map, measured, unit_mm, rays, cubics, out };
            if let Some(counts) = from_u16::<I, true>(isa, pixels) {
                summary.corrected += counts.points;
                summary.invalid += count - counts.depths;
                summary.not_correctable += counts.depths - counts.points;
                return true;
            }
        }
        if count > CHUNK {
            return false;
        }

        self.chunk(isa, input, offset, count, summary);
        true
    }

    /// Corrects at most [`CHUNK`] pixels stage by stage in f32, with what f32 cannot do in f64, and adds to the summary.
    #[inline(always)]
    fn chunk<I: Isa>(
        &mut self,
        isa: I,
        input: Input<'_>,
        offset: usize,
        count: usize,
        summary: &mut CorrectionSummary,
    ) {
        let Self { frame, output, .. } = self;
        let (first, in_band) = (self.first + offset, offset..offset + count);
        let prepared = frame.prepared;
        let rays = [0, 1].map(|k| &prepared.ray_planes[k][first..first + count]);
        let mut z = [0.0f32; CHUNK];
        let z = &mut z[..count];
        match input {
            Input::U16(measured) => load(measured, frame.unit_mm as f32, z),
            Input::F32(measured) => load(measured, 1.0, z),
            Input::Output => {}
        }
        let (depths, _) = count_f32(z);
        match (frame.plan, &*output) {
            (Some((plan, inputs)), Output::Points(_)) => plan.correct_on_rays(isa, inputs, first, rays, z),
            (Some((plan, inputs)), _) => plan.correct(isa, inputs, first, z),
            (None, _) => z.iter_mut().for_each(|z| *z = if *z > 0.0 { f32::NAN } else { *z }),
        }
        let (mut corrected, nans) = count_f32(z);
        if nans > 0 {
            let measured_mm = |i: usize| match input {
                Input::U16(measured) => f64::from(measured[i]) * frame.unit_mm,
                Input::F32(measured) => f64::from(measured[i]),
                Input::Output => f64::NAN,
            };
            frame.fill_in(first, measured_mm, z);
            corrected = count_f32(z).0;
        }
        summary.corrected += corrected;
        summary.invalid += count - depths;
        summary.not_correctable += depths - corrected;
        summary.saturated += match output {
            Output::U16(out) => {
                let per_mm = (1.0 / frame.unit_mm) as f32;
                let out = &mut out[in_band];
                let beyond = store_u16(z, per_mm, out);
                let mut distances = [0.0f32; CHUNK];
                if let Input::U16(measured) = input
                    && near_half(measured, z, per_mm, frame.error_steps(), &mut distances[..count])
                {
                    frame.round_again(first, measured, z, &distances[..count], out);
                }
                beyond
            }
            Output::F32(out) => store_f32(z, &mut out[in_band]),
            Output::Points(out) => {
                store_points(isa, prepared, first, z, out.part(offset, count));
                0
            }
        };
    }
}

/// Writes into `distances` how far each depth is from the middle between two steps, less its possible error, in steps.
/// Returns whether any distance is 0 or below, so that the depth may have been rounded to the wrong step. Errors below
/// [`MOST_ERROR`] are tolerated; the distance is 1 then.
#[inline(always)]
fn near_half(measured: &[u16], z: &[f32], per_mm: f32, error_steps: f32, distances: &mut [f32]) -> bool {
    let mut undecided = 0u32;
    for ((raw, z), distance) in measured.iter().zip(z).zip(distances) {
        let steps = *z * per_mm;
        let missing = (steps - ((steps + ROUND) - ROUND)).abs();
        // The change of depth has an error in proportion to its own size, also where the result is small.
        let change = (steps - f32::from(measurement(*raw))).abs();
        let error = error_steps + steps * F32_ROUNDING + change * (2.0 * F32_ROUNDING);
        *distance = if error > MOST_ERROR { (0.5 - missing) - error } else { 1.0 };
        undecided += u32::from(*distance <= 0.0);
    }
    undecided > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_near_the_middle_between_two_steps_is_undecided() {
        // Corrected depth, mm, measured 20 000 steps of 1 mm, error without that of f32.
        let distance = |z: f32, error_steps: f32| {
            let mut distances = [f32::NAN];
            let undecided = near_half(&[20_000], &[z], 1.0, error_steps, &mut distances);
            (undecided, distances[0])
        };
        // A quarter of a step from the next integer, so a quarter from the middle. f32 explains 20 100 · 2.5e-7, and twice that
        // of the change of 100 steps.
        let (undecided, distance_mm) = distance(20_100.25, 0.01);
        assert!(!undecided && (distance_mm - (0.25 - 0.01 - 0.005_075)).abs() < 1e-4, "{distance_mm}");
        assert!(distance(20_100.25, 0.26).0);
        assert!((distance(20_099.75, 0.01).1 - distance_mm).abs() < 1e-6);
        assert!(distance(20_100.5, 0.01).0);
        // Errors that are tolerated.
        let mut distances = [f32::NAN];
        assert!(!near_half(&[10], &[10.5], 1.0, 1e-4, &mut distances));
        assert_eq!(distances, [1.0]);
    }
}
