//! Floating-point depth in units of a caller.
//!
//! The conversion is that of the command line, so that both give the same bits.

use depthcal_correction::{CorrectionSummary, Corrector, CorrectorError, FrameContext};
use rayon::prelude::*;

/// Numbers that one thread converts at a time.
const CHUNK: usize = 1 << 14;

/// Converts depth in units to mm in place.
fn to_mm(depth: &mut [f32], unit_mm: f64) {
    depth.par_chunks_mut(CHUNK).for_each(|chunk| {
        for z in chunk {
            *z = (f64::from(*z) * unit_mm) as f32;
        }
    });
}

/// Depth in units as mm.
pub(crate) fn millimetres(depth: &[f32], unit_mm: f64) -> Vec<f32> {
    let mut mm = depth.to_vec();
    to_mm(&mut mm, unit_mm);
    mm
}

/// Converts depth in mm to units in place.
fn to_units(depth_mm: &mut [f32], unit_mm: f64) {
    depth_mm.par_chunks_mut(CHUNK).for_each(|chunk| {
        for z in chunk {
            *z = in_units(*z, unit_mm);
        }
    });
}

/// Depth in units of depth in mm.
pub(crate) fn in_units(depth_mm: f32, unit_mm: f64) -> f32 {
    (f64::from(depth_mm) / unit_mm) as f32
}

/// Corrects depth in units into mm. `depth` is that in `out_mm` where it is not given.
pub(crate) fn correct_to_mm(
    corrector: &Corrector,
    depth: Option<&[f32]>,
    unit_mm: f64,
    context: &FrameContext<'_>,
    out_mm: &mut [f32],
) -> Result<CorrectionSummary, CorrectorError> {
    match depth {
        Some(depth) if unit_mm == 1.0 => return corrector.correct_f32(depth, context, out_mm),
        Some(depth) => out_mm.copy_from_slice(depth),
        None => {}
    }
    if unit_mm != 1.0 {
        to_mm(out_mm, unit_mm);
    }
    corrector.correct_f32_in_place(out_mm, context)
}

/// Corrects depth in units into these units, as [`correct_to_mm`].
pub(crate) fn correct(
    corrector: &Corrector,
    depth: Option<&[f32]>,
    unit_mm: f64,
    context: &FrameContext<'_>,
    out: &mut [f32],
) -> Result<CorrectionSummary, CorrectorError> {
    let summary = correct_to_mm(corrector, depth, unit_mm, context, out)?;
    if unit_mm != 1.0 {
        to_units(out, unit_mm);
    }
    Ok(summary)
}
