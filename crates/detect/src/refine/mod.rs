//! Refinement of markers by fitting a model of their appearance to the raw grey values.

mod crossing;
mod disc;
mod fit;
mod pixels;

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};
use nalgebra::Matrix2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::circles::step_mm;
use crate::detection::{Detection, Marker, kind};
use crate::error::DetectError;
use crate::geometry::{BoardMap, LocalMap};
use crate::stretch;
use crossing::Shape;
use disc::{Disc, fit_disc};
pub(crate) use pixels::Pixels;

/// A marker after refinement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RefinedMarker {
    /// Index in the order of [`Target::point`].
    pub index: usize,
    /// Where the marker's defined point is seen, px.
    pub pixel: [f64; 2],
    /// Standard deviation of one coordinate of `pixel`, px, from the scatter of the grey values about the model. Errors
    /// that neighbouring pixels share, such as an uneven print, come on top.
    pub std_px: f64,
    /// Scatter of the grey values about the model over the contrast of the marker.
    pub relative_noise: f64,
    /// Standard deviation of the blur of the marker's edge, px.
    pub blur_px: f64,
    /// Contrast between print and paper in grey values of the image.
    pub contrast: f64,
    /// Fitted over declared radius, for dots; 1 for others.
    pub radius_ratio: f64,
}

/// How markers are refined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RefineOptions {
    /// Largest number of iterations for a marker.
    pub iterations: usize,
    /// Relative standard deviation of the printed dots' radius about the declared one; 0 holds it fixed.
    pub radius_sigma: f64,
    /// Size of the neighbourhood in which a chessboard's crossing is fitted: radius over the distance to the next one.
    pub corner_reach: f64,
    /// Largest such radius, px: a lens bends edges.
    pub max_corner_reach_px: f64,
}

impl Default for RefineOptions {
    fn default() -> Self {
        RefineOptions { iterations: 30, radius_sigma: 0.1, corner_reach: 0.5, max_corner_reach_px: 10.0 }
    }
}

/// A first mapping from the board (mm) to the image (px), for [`refine_circles`] before there is a camera: a homography
/// and a smooth correction for the lens. `None` when the markers do not fix it.
pub fn homography_mapping(detection: &Detection, target: &Target) -> Option<BoardMap> {
    let pairs: Vec<_> =
        detection.markers.iter().filter(|m| m.index < target.len()).map(|m| (target.point(m.index), m.pixel)).collect();
    BoardMap::fit(&pairs)
}

/// Finds the centres of a circle grid's dots with the current mapping from the board (mm) to the image (px), as
/// calibration goes along: calibrate, refine, calibrate again (Datta, Kim, Kanade 2009).
///
/// Instead of rectifying the image, every pixel around a dot is mapped to the board and an ideal disc, blurred as
/// the image is, is fitted there by its centre, radius, contrast, light and blur. Pixels are used as measured, and the
/// bias of circle centres under perspective and lens is gone to the accuracy of the mapping's curvature within a dot.
///
/// `pixel_from_board` may return `None` where it is undefined. Dots that cannot be fitted (hidden, cut off by the
/// border, without contrast) are left out.
///
/// # Errors
/// When the board has no dots, when a marker is not on the board, or when the image is inconsistent.
pub fn refine_circles(
    image: &GrayImage,
    detection: &Detection,
    target: &Target,
    pixel_from_board: &(dyn Fn([f64; 2]) -> Option<[f64; 2]> + Sync),
    options: &RefineOptions,
) -> Result<Vec<RefinedMarker>, DetectError> {
    check(image, detection, target)?;
    let diameter =
        target.circle_diameter_mm().ok_or(DetectError::WrongKind { kind: kind(target), markers: "circles" })?;
    let pixels = Pixels::new(image);
    let radius = diameter / 2.0;
    let gap = (step_mm(target) - diameter).max(0.0);
    let refined = detection
        .markers
        .par_iter()
        .map(|marker| {
            let center = target.point(marker.index);
            // The mapping may be off by some pixels while it lacks the lens: start where the dot was seen.
            let nominal = pixel_from_board(center)?;
            let shift = [marker.pixel[0] - nominal[0], marker.pixel[1] - nominal[1]];
            let seen = |p: [f64; 2]| pixel_from_board(p).map(|q| [q[0] + shift[0], q[1] + shift[1]]);
            let map = LocalMap::new(&seen, center, radius + 0.6 * gap)?;
            let disc = Disc { center, radius, gap, radius_sigma: options.radius_sigma };
            let fitted = fit_disc(&pixels, &map, &disc, options.iterations)?;
            let pixel = seen(fitted.center)?;
            let (_, to_board) = map.apply(pixel);
            let to_pixel = to_board.try_inverse()?;
            Some(RefinedMarker {
                index: marker.index,
                pixel,
                std_px: standard_deviation(&(to_pixel * fitted.covariance * to_pixel.transpose())),
                relative_noise: fitted.relative_noise,
                blur_px: fitted.width_px,
                contrast: fitted.contrast.abs(),
                radius_ratio: fitted.radius / radius,
            })
        })
        .collect::<Vec<Option<RefinedMarker>>>();
    Ok(refined.into_iter().flatten().collect())
}

/// Finds the crossings of a chessboard or ChArUco board, or the corners of tags, by fitting two soft edges to the grey
/// values around each. A corner is a point in perspective, so no camera is needed. Those that cannot be fitted are
/// left out.
///
/// # Errors
/// When the board has no corners, when a marker is not on the board, or when the image is inconsistent.
pub fn refine_corners(
    image: &GrayImage,
    detection: &Detection,
    target: &Target,
    options: &RefineOptions,
) -> Result<Vec<RefinedMarker>, DetectError> {
    check(image, detection, target)?;
    if target.circle_diameter_mm().is_some() {
        return Err(DetectError::WrongKind { kind: kind(target), markers: "corners" });
    }
    let Some(map) = homography_mapping(detection, target) else { return Ok(Vec::new()) };
    let pixels = Pixels::new(image);
    let refined = detection
        .markers
        .par_iter()
        .map(|marker| {
            let p = target.point(marker.index);
            let (shape, axes, clear_mm) = surroundings(target, marker.index, options)?;
            let half = clear_mm;
            let difference = |d: [f64; 2]| {
                let (a, b) = (
                    map.apply([p[0] - half * d[0], p[1] - half * d[1]])?,
                    map.apply([p[0] + half * d[0], p[1] + half * d[1]])?,
                );
                Some([(b[0] - a[0]) / 2.0, (b[1] - a[1]) / 2.0])
            };
            let axes = [difference(axes[0])?, difference(axes[1])?];
            let shortest = axes[0][0].hypot(axes[0][1]).min(axes[1][0].hypot(axes[1][1]));
            let reach = shortest.clamp(MIN_REACH_PX, options.max_corner_reach_px.max(MIN_REACH_PX));
            let fitted = crossing::fit_crossing(&pixels, shape, marker.pixel, axes, reach, options.iterations)?;
            Some(RefinedMarker {
                index: marker.index,
                pixel: fitted.pixel,
                std_px: standard_deviation(&fitted.covariance),
                relative_noise: fitted.relative_noise,
                blur_px: fitted.width_px,
                contrast: fitted.contrast,
                radius_ratio: 1.0,
            })
        })
        .collect::<Vec<Option<RefinedMarker>>>();
    Ok(refined.into_iter().flatten().collect())
}

/// Smallest neighbourhood that determines a crossing, px.
const MIN_REACH_PX: f64 = 2.6;

/// What a corner looks like: its shape, the board's directions along its edges (right-handed, for a tag's corner into
/// the tag), and how far around it nothing else is printed, mm.
fn surroundings(target: &Target, index: usize, options: &RefineOptions) -> Option<(Shape, [[f64; 2]; 2], f64)> {
    let (x, y) = ([1.0, 0.0], [0.0, 1.0]);
    let square = target.spacing_mm * options.corner_reach;
    match target.pattern {
        Pattern::Chessboard => Some((Shape::Crossing, [x, y], square)),
        Pattern::Charuco { marker_mm, .. } => {
            // Up to the tags in the white squares.
            let margin = (target.spacing_mm - marker_mm) / 2.0 * std::f64::consts::SQRT_2;
            Some((Shape::Crossing, [x, y], margin.min(square)))
        }
        Pattern::Aprilgrid { marker_mm } => {
            // The tag's black border is one of eight cells wide; its inner corner is √2 of that away.
            let clear = (1.3 * marker_mm / 8.0).min(0.9 * (target.spacing_mm - marker_mm));
            let axes = [[x, y], [y, [-1.0, 0.0]], [[-1.0, 0.0], [0.0, -1.0]], [[0.0, -1.0], x]][index % 4];
            Some((Shape::Corner, axes, clear))
        }
        Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => None,
    }
}

fn standard_deviation(covariance: &Matrix2<f64>) -> f64 {
    (covariance.trace() / 2.0).max(0.0).sqrt()
}

fn check(image: &GrayImage, detection: &Detection, target: &Target) -> Result<(), DetectError> {
    stretch::check(image)?;
    match detection.markers.iter().find(|m| m.index >= target.len()) {
        Some(marker) => Err(DetectError::MarkerIndex { index: marker.index, len: target.len() }),
        None => Ok(()),
    }
}

/// Replaces the centres of gravity of a detection by fitted centres, with a mapping from the markers themselves.
pub(crate) fn sharpen_circles(
    image: &GrayImage,
    detection: &mut Detection,
    target: &Target,
) -> Result<(), DetectError> {
    let options = RefineOptions::default();
    // The second round has the better mapping; a third changes nothing.
    for last in [false, true] {
        let Some(map) = homography_mapping(detection, target) else { break };
        let refined = refine_circles(image, detection, target, &|p| map.apply(p), &options)?;
        if last { keep_clear(detection, &refined) } else { take_over(detection, &refined) }
    }
    Ok(())
}

/// Markers whose scatter about the model is this many times that of the others show something else as well: a reflex,
/// dirt, a finger.
const UNCLEAR: f64 = 4.0;
/// Scatter that is never held against a marker.
const ORDINARY_NOISE: f64 = 0.06;
/// Part of the markers that must be clear for the others to be dropped.
const CLEAR_PART: f64 = 0.75;

/// Moves markers to where they were refined to and drops those that are not clear; if too many are not, they stay.
pub(crate) fn keep_clear(detection: &mut Detection, refined: &[RefinedMarker]) {
    let mut noise: Vec<f64> = refined.iter().map(|r| r.relative_noise).collect();
    noise.sort_by(f64::total_cmp);
    let limit = noise.get(noise.len() / 2).map_or(0.0, |median| (UNCLEAR * median).max(ORDINARY_NOISE));
    let clear: Vec<RefinedMarker> = refined.iter().filter(|r| r.relative_noise <= limit).copied().collect();
    if (clear.len() as f64) < CLEAR_PART * detection.markers.len() as f64 {
        take_over(detection, refined);
        return;
    }
    detection.markers = clear.iter().map(|r| Marker { index: r.index, pixel: r.pixel }).collect();
}

/// Moves markers to where they were refined to; the others stay.
pub(crate) fn take_over(detection: &mut Detection, refined: &[RefinedMarker]) {
    for r in refined {
        if let Ok(at) = detection.markers.binary_search_by_key(&r.index, |m| m.index) {
            detection.markers[at].pixel = r.pixel;
        }
    }
}
