//! Correction of a whole frame.

use super::band::Band;
use super::buffers::{Input, Output};
use super::current_frame::CurrentFrame;
use super::incidence;
use crate::bands::for_bands;
use crate::frame_context::FrameContext;
use crate::light::{FrameLight, MeasuredDepth};
use crate::prepared::PreparedCamera;
use crate::simd::dispatch;
use crate::summary::CorrectionSummary;

/// Corrects `input` into `output`. Depth in steps has `unit_mm` per step, in both. Sizes must have been checked.
pub(crate) fn correct(
    prepared: &PreparedCamera,
    input: Input<'_>,
    unit_mm: f64,
    context: &FrameContext<'_>,
    output: Output<'_>,
) -> CorrectionSummary {
    let light = frame_light(prepared, input, unit_mm, context, &output);
    let frame = Frame { prepared, unit_mm, context, light: light.as_ref() };
    if !prepared.needs.incidence {
        return correct_at(frame, input, None, output);
    }
    // The angle of incidence comes from the surface, and the surface from a first correction that assumes a right
    // angle. That is near enough: what the angle changes in depth hardly changes the slope of the surface.
    let mut first = vec![0.0f32; prepared.pixels()];
    let measured = match (input, &output) {
        (Input::Output, Output::U16(depth)) => Input::U16(depth),
        (Input::Output, Output::F32(depth)) => Input::F32(depth),
        (input, _) => input,
    };
    correct_at(frame, measured, None, Output::F32(&mut first));
    let cosines = incidence::cosines(prepared.camera.width, &first, |index, rho| prepared.ray(index, rho));
    correct_at(frame, input, Some(&cosines), output)
}

/// The light of a frame, where an effect depends on it and the frame has an infrared image.
fn frame_light(
    prepared: &PreparedCamera,
    input: Input<'_>,
    unit_mm: f64,
    context: &FrameContext<'_>,
    output: &Output<'_>,
) -> Option<FrameLight> {
    let (modulation, amplitude) = (prepared.modulation?, context.amplitude?);
    let depth = match (input, output) {
        (Input::U16(steps), _) => MeasuredDepth::Steps(steps, unit_mm as f32),
        (Input::F32(depth_mm), _) => MeasuredDepth::Millimetres(depth_mm),
        (Input::Output, Output::U16(steps)) => MeasuredDepth::Steps(steps, unit_mm as f32),
        (Input::Output, Output::F32(depth_mm)) => MeasuredDepth::Millimetres(depth_mm),
        (Input::Output, Output::Points(_)) => return None,
    };
    FrameLight::new(modulation, prepared.camera.width, &prepared.slants, amplitude.data, depth)
}

/// A frame and its light, apart from its depth.
#[derive(Clone, Copy)]
struct Frame<'a> {
    prepared: &'a PreparedCamera,
    unit_mm: f64,
    context: &'a FrameContext<'a>,
    light: Option<&'a FrameLight>,
}

/// [`correct`] at given cosines of the angle of incidence, one per pixel; at a right angle where there are none.
fn correct_at(
    Frame { prepared, unit_mm, context, light }: Frame<'_>,
    input: Input<'_>,
    cosines: Option<&[f32]>,
    output: Output<'_>,
) -> CorrectionSummary {
    let plan = prepared.plan.as_ref().map(|plan| (plan, plan.inputs(context, cosines, light)));
    let frame = CurrentFrame { prepared, context, cosines, light, plan: plan.as_ref(), unit_mm };
    for_bands(prepared.pixels(), output, &|first, count, output| dispatch(Band { frame, input, output, first, count }))
}
