//! Correction of a whole frame.

use super::band::Band;
use super::buffers::{Input, Output};
use super::current_frame::CurrentFrame;
use super::incidence;
use crate::bands::for_bands;
use crate::frame_context::FrameContext;
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
    if !prepared.needs.incidence {
        return correct_at(prepared, input, unit_mm, context, None, output);
    }
    // The angle of incidence comes from the surface, and the surface from a first correction that assumes a right
    // angle. That is near enough: what the angle changes in depth hardly changes the slope of the surface.
    let mut first = vec![0.0f32; prepared.pixels()];
    let measured = match (input, &output) {
        (Input::Output, Output::U16(depth)) => Input::U16(depth),
        (Input::Output, Output::F32(depth)) => Input::F32(depth),
        (input, _) => input,
    };
    correct_at(prepared, measured, unit_mm, context, None, Output::F32(&mut first));
    let cosines = incidence::cosines(prepared.camera.width, &first, |index, rho| prepared.ray(index, rho));
    correct_at(prepared, input, unit_mm, context, Some(&cosines), output)
}

/// [`correct`] at given cosines of the angle of incidence, one per pixel; at a right angle where there are none.
fn correct_at(
    prepared: &PreparedCamera,
    input: Input<'_>,
    unit_mm: f64,
    context: &FrameContext<'_>,
    cosines: Option<&[f32]>,
    output: Output<'_>,
) -> CorrectionSummary {
    let plan = prepared.plan.as_ref().map(|plan| (plan, plan.inputs(context, cosines)));
    let frame = CurrentFrame { prepared, context, cosines, plan: plan.as_ref(), unit_mm };
    for_bands(prepared.pixels(), output, &|first, count, output| dispatch(Band { frame, input, output, first, count }))
}
