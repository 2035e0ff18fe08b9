//! The search over all alternatives to declared depth.

use depthcal_io::ImageError;
use depthcal_model::Camera;
use rayon::prelude::*;

use super::depth_alternative::{DepthAlternative, Quantity, Turn};
use super::depth_cause::DepthCause;
use super::depth_points::{Deviation, FramePoints, deviation, trivial, with_affine_error};
use super::registration::registration;
use crate::observe::{Capture, PosedFrame};

/// Frames that are looked at, spread over the capture.
const FRAMES: usize = 16;
/// Declared depth within this relative deviation of the boards is not doubted.
const UNDOUBTED: f64 = 0.008;
/// An alternative is clearly better with this share of a deviation …
const CLEARLY: f64 = 1.0 / 3.0;
/// … and leaves at most this one: depth cameras before their calibration.
const MOST: f64 = 0.04;
/// Alternatives within this factor of each other fit alike.
const ALIKE: f64 = 1.5;
/// Least share of the points with a measurement.
const LEAST_COVERAGE: f64 = 0.15;
/// Relative deviation from which on depth contradicts the boards, whatever its scale.
const CONTRADICTS: f64 = 0.08;

/// Depth as declared, held against the boards that the images show.
#[derive(Debug, Clone, PartialEq)]
pub enum DepthFinding {
    /// There is nothing to say against it.
    Fits,
    /// It contradicts the boards, and this is why.
    Cause(DepthCause),
    /// It contradicts the boards by this relative deviation, and no alternative fits.
    Unexplained(f64),
}

/// Holds depth as it is declared against the boards that the images show and, where it deviates, tries all alternatives.
///
/// # Errors
///
/// [`ImageError`] where a depth image has become unreadable.
pub fn examine_depth(capture: &Capture<PosedFrame>, camera: &Camera) -> Result<DepthFinding, ImageError> {
    let with_depth: Vec<usize> =
        (0..capture.frames.len()).filter(|i| capture.frames[*i].depth_image().is_some()).collect();
    let step = with_depth.len().div_ceil(FRAMES).max(1);
    let chosen: Vec<usize> = with_depth.into_iter().step_by(step).collect();
    if chosen.is_empty() {
        return Ok(DepthFinding::Fits);
    }
    let points = |frames: &[isize], turns: &[Turn]| -> Result<Vec<FramePoints>, ImageError> {
        chosen.par_iter().map(|number| FramePoints::of(capture, camera, *number, frames, turns)).collect()
    };
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    let declared = deviation(&points(&[0], &[Turn::Upright])?, unit_mm, DepthAlternative::DECLARED);
    if declared.is_some_and(|declared| declared.relative <= UNDOUBTED) {
        return Ok(DepthFinding::Fits);
    }
    let frames = points(&DepthAlternative::FRAMES, &Turn::ALL)?;
    let limit = declared.map_or(f64::INFINITY, |declared| declared.relative);
    let spacing_mm = capture.target.spacing_mm;
    if let Some((alternative, deviation)) = best(&frames, unit_mm, limit) {
        return Ok(DepthFinding::Cause(DepthCause::Other { alternative, declared, deviation, unit_mm, spacing_mm }));
    }
    if let Some(registration) = registration(capture, camera, &chosen, unit_mm, limit)? {
        return Ok(DepthFinding::Cause(DepthCause::OtherGrid { registration, declared }));
    }
    let is_contradiction = limit > CONTRADICTS;
    Ok(if is_contradiction { DepthFinding::Unexplained(limit) } else { DepthFinding::Fits })
}

/// The alternative that fits clearly better than the declaration, whose deviation is given, and than all others.
fn best(frames: &[FramePoints], unit_mm: f64, declared: f64) -> Option<(DepthAlternative, Deviation)> {
    let trivial = trivial(frames);
    let affine = with_affine_error(frames);
    let limit = |alternative: DepthAlternative| {
        let limit = MOST.min(CLEARLY * declared).min(CLEARLY * trivial);
        // A disparity has one freedom more than depth, which depth with such an error has as well.
        if alternative.quantity == Quantity::Disparity { limit.min(CLEARLY * affine) } else { limit }
    };
    let fitted: Vec<(DepthAlternative, Deviation)> = DepthAlternative::all()
        .filter(|alternative| *alternative != DepthAlternative::DECLARED)
        .filter_map(|alternative| Some((alternative, deviation(frames, unit_mm, alternative)?)))
        .filter(|(alternative, deviation)| {
            deviation.relative <= limit(*alternative) && deviation.coverage >= LEAST_COVERAGE
        })
        .collect();
    let least = fitted.iter().map(|(_, deviation)| deviation.relative).fold(f64::INFINITY, f64::min);
    let alike: Vec<_> = fitted.into_iter().filter(|(_, d)| d.relative <= ALIKE * least).collect();
    let faults = alike.iter().map(|(alternative, _)| alternative.faults()).min()?;
    let mut simplest = alike.into_iter().filter(|(alternative, _)| alternative.faults() == faults);
    match (simplest.next(), simplest.next()) {
        (Some(only), None) => Some(only),
        _ => None,
    }
}
