//! The diameter of printed dots, measured in an image.
//!
//! A dot's edge is where the fitted disc ends, on the board: the mapping from board to image, which the dots' own centres
//! give, turns px into mm. Only the ratio of diameter to spacing is measured so; its unit is that of the declared spacing.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use serde::{Deserialize, Serialize};

use super::circles::refine_circles;
use super::mapping::homography_mapping;
use super::marker::RefineOptions;
use crate::board::step_mm;
use crate::detection::Detection;
use crate::error::DetectError;
use crate::geometry::BoardMap;

/// Diameters to start from where none is known, or the known one is wrong, over the distance of neighbouring dots.
const STARTS: [f64; 5] = [0.65, 0.5, 0.8, 0.35, 0.25];
/// Prior standard deviation of the radius relative to the start: it hardly matters.
const RADIUS_SIGMA: f64 = 0.5;
/// Least share of dots that a fit must succeed for.
const LEAST_SHARE: f64 = 0.5;
/// Rounds that begin at the diameter of the round before, so that the fitted neighbourhood fits the dot.
const ROUNDS: usize = 2;

/// The diameter of a board's dots, measured in one image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CircleDiameter {
    /// Median diameter of the dots, mm, in the scale of the board's spacing.
    pub diameter_mm: f64,
    /// Standard deviation of the median, from the scatter of the dots, mm. Errors that all dots of an image share are not
    /// in it (overexposure makes dark dots smaller): compare several images.
    pub std_mm: f64,
    /// Number of dots that were measured.
    pub dots: usize,
}

/// Measures the diameter of the dots of a board that was found; the target's own diameter, if it has one, is only the
/// first start. `None` when no disc can be fitted to half of the dots.
///
/// # Errors
/// [`DetectError`] when the board has no dots, a marker is not on the board, or the image is inconsistent.
pub fn measure_circle_diameter(
    image: &GrayImage,
    detection: &Detection,
    target: &Target,
) -> Result<Option<CircleDiameter>, DetectError> {
    let step = step_mm(target);
    let starts = target.circle_diameter_mm().into_iter().chain(STARTS.map(|share| share * step));
    let mut best: Option<(f64, CircleDiameter)> = None;
    for (number, start) in starts.enumerate() {
        let mut round = fit(image, detection, target, start)?;
        for _ in 1..ROUNDS {
            let Some((_, measured)) = round else { break };
            round = fit(image, detection, target, measured.diameter_mm)?;
        }
        let Some((noise, measured)) = round else { continue };
        if best.is_none_or(|(least, _)| noise < least) {
            best = Some((noise, measured));
        }
        // A declared diameter that the image confirms needs no other start.
        let confirmed = (0.85..1.18).contains(&(measured.diameter_mm / start));
        if number == 0 && target.circle_diameter_mm().is_some() && confirmed {
            break;
        }
    }
    Ok(best.map(|(_, measured)| measured))
}

/// The diameter from one start, and the median scatter of the grey values about the discs, relative to their contrast.
fn fit(
    image: &GrayImage,
    detection: &Detection,
    target: &Target,
    start_mm: f64,
) -> Result<Option<(f64, CircleDiameter)>, DetectError> {
    let Some(map) = homography_mapping(detection, target) else { return Ok(None) };
    if !(start_mm > 0.0 && start_mm < step_mm(target)) {
        return Ok(None);
    }
    let sized = target.with_circle_diameter_mm(start_mm);
    let options = RefineOptions { radius_sigma: RADIUS_SIGMA, ..RefineOptions::default() };
    let refined = refine_circles(image, detection, &sized, &|p| map.apply(p), &options)?;
    if refined.len() < 4 || (refined.len() as f64) < LEAST_SHARE * detection.markers.len() as f64 {
        return Ok(None);
    }
    let noise = median(refined.iter().map(|r| r.relative_noise));
    let diameters: Vec<f64> = refined
        .iter()
        .filter_map(|r| Some(unbent(start_mm * r.radius_ratio, r.blur_px, px_per_mm(&map, target.point(r.index))?)))
        .collect();
    if diameters.is_empty() {
        return Ok(None);
    }
    let diameter_mm = median(diameters.iter().copied());
    let deviation = median(diameters.iter().map(|d| (d - diameter_mm).abs()));
    // 1.4826: from the median deviation to the standard deviation of a normal distribution; 1.2533: from the standard
    // deviation of a mean to that of a median.
    let std_mm = 1.2533 * 1.4826 * deviation / (refined.len() as f64).sqrt();
    Ok(Some((noise, CircleDiameter { diameter_mm, std_mm, dots: refined.len() })))
}

/// The diameter (mm) of a dot, from that of the straight blurred edges fitted to it. Blur moves the middle of a bent edge
/// inwards by σ²/(2 R), to first order in the curvature 1/R.
fn unbent(fitted_mm: f64, blur_px: f64, px_per_mm: f64) -> f64 {
    let radius_px = fitted_mm / 2.0 * px_per_mm;
    fitted_mm + blur_px * blur_px / radius_px / px_per_mm
}

/// Scale of the image at a board point: the square root of the areas' ratio.
fn px_per_mm(map: &BoardMap, [x, y]: [f64; 2]) -> Option<f64> {
    let (centre, right, down) = (map.apply([x, y])?, map.apply([x + 1.0, y])?, map.apply([x, y + 1.0])?);
    let (a, b) = ([right[0] - centre[0], right[1] - centre[1]], [down[0] - centre[0], down[1] - centre[1]]);
    Some((a[0] * b[1] - a[1] * b[0]).abs().sqrt()).filter(|scale| *scale > 0.0)
}

/// The upper median of at least one number.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
