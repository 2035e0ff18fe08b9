//! Refinement of the crossings of chessboards and the corners of tags.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};
use rayon::prelude::*;

use super::crossing::{FittedCrossing, Shape, fit_crossing};
use super::mapping::homography_mapping;
use super::marker::{RefineOptions, RefinedMarker, standard_deviation};
use super::pixels::Pixels;
use crate::board::kind;
use crate::check::{check_image, check_markers};
use crate::detection::{Detection, Marker};
use crate::error::DetectError;

/// Radius of the smallest neighbourhood that determines a crossing, px.
const MIN_REACH_PX: f64 = 2.6;

/// Fits the crossings of a chessboard or ChArUco board, or the corners of tags: two blurred edges are fitted to the
/// grey values around each. Perspective maps a corner to a corner, so no camera is needed. Corners that cannot be
/// fitted are left out; all are when the markers do not determine a homography.
///
/// # Errors
/// [`DetectError`] when the board has no corners, a marker is not on the board, or the image is inconsistent.
pub fn refine_corners(
    image: &GrayImage,
    detection: &Detection,
    target: &Target,
    options: &RefineOptions,
) -> Result<Vec<RefinedMarker>, DetectError> {
    check_image(image)?;
    check_markers(detection, target)?;
    if target.has_circles() {
        return Err(DetectError::WrongKind { kind: kind(target), markers: "corners" });
    }
    let Some(map) = homography_mapping(detection, target) else { return Ok(Vec::new()) };
    let pixels = Pixels::new(image);
    let refined = detection
        .markers
        .par_iter()
        .map(|marker| {
            let (fitted, _) = fit_corner(&pixels, target, marker, &|p| map.apply(p), options)?;
            Some(RefinedMarker {
                index: marker.index,
                pixel: fitted.pixel,
                std_px: standard_deviation(&fitted.covariance),
                relative_noise: fitted.relative_noise,
                blur_px: fitted.width_px,
                contrast: fitted.contrast.abs(),
                radius_ratio: 1.0,
            })
        })
        .collect::<Vec<Option<RefinedMarker>>>();
    Ok(refined.into_iter().flatten().collect())
}

/// Fits one crossing or corner near `marker.pixel`. `pixel_from_board` maps the board (mm) to the image (px) around it;
/// only the directions and lengths that it gives are used. Also returns the distance, px, within which nothing else is
/// printed. `None` when there is no such corner, or the map is undefined.
pub(crate) fn fit_corner(
    pixels: &Pixels,
    target: &Target,
    marker: &Marker,
    pixel_from_board: &dyn Fn([f64; 2]) -> Option<[f64; 2]>,
    options: &RefineOptions,
) -> Option<(FittedCrossing, f64)> {
    let mut best: Option<(FittedCrossing, f64)> = None;
    for look in appearances(target, marker.index, options) {
        let Some(fit) = fit_as(&look, pixels, target, marker, pixel_from_board, options) else { continue };
        let is_clear = fit.0.relative_noise < CLEAR;
        if best.as_ref().is_none_or(|best| fit.0.relative_noise < best.0.relative_noise) {
            best = Some(fit);
        }
        if is_clear {
            break;
        }
    }
    best
}

/// Scatter about the model, relative to the contrast, below which a corner looks as it was thought to: no other appearance is
/// tried.
const CLEAR: f64 = 0.06;

/// The fit of one appearance.
fn fit_as(
    &Appearance { shape, axes, half }: &Appearance,
    pixels: &Pixels,
    target: &Target,
    marker: &Marker,
    pixel_from_board: &dyn Fn([f64; 2]) -> Option<[f64; 2]>,
    options: &RefineOptions,
) -> Option<(FittedCrossing, f64)> {
    let p = target.point(marker.index);
    let difference = |d: [f64; 2]| {
        let (a, b) = (
            pixel_from_board([p[0] - half * d[0], p[1] - half * d[1]])?,
            pixel_from_board([p[0] + half * d[0], p[1] + half * d[1]])?,
        );
        Some([(b[0] - a[0]) / 2.0, (b[1] - a[1]) / 2.0])
    };
    let axes = [difference(axes[0])?, difference(axes[1])?];
    let shortest = axes[0][0].hypot(axes[0][1]).min(axes[1][0].hypot(axes[1][1]));
    let reach = shortest.clamp(MIN_REACH_PX, options.max_corner_reach_px.max(MIN_REACH_PX));
    let fitted = fit_crossing(pixels, shape, marker.pixel, axes, reach, options.iterations)?;
    Some((fitted, shortest))
}

/// How a corner may look.
struct Appearance {
    shape: Shape,
    /// Directions of its two edges on the board, right-handed; for a tag's corner they point into the tag.
    axes: [[f64; 2]; 2],
    /// Radius within which nothing else is printed, mm.
    half: f64,
}

/// Cells of a tag of 36h11 along a side, with a border of one cell, and with one of two as Kalibr prints it.
const CELLS: [f64; 2] = [8.0, 10.0];

/// The appearances that a corner may have. That of a tag is a corner on paper, or, where Kalibr has drawn the board, a crossing
/// with the black square between the tags.
fn appearances(target: &Target, index: usize, options: &RefineOptions) -> Vec<Appearance> {
    let (x, y) = ([1.0, 0.0], [0.0, 1.0]);
    let square = target.spacing_mm * options.corner_reach;
    let crossing = |half: f64| vec![Appearance { shape: Shape::Crossing, axes: [x, y], half }];
    match target.pattern {
        Pattern::Chessboard => crossing(square),
        Pattern::Charuco { marker_mm, .. } => {
            // As far as the tags in the white squares.
            let margin = (target.spacing_mm - marker_mm) / 2.0 * std::f64::consts::SQRT_2;
            crossing(margin.min(square))
        }
        Pattern::Aprilgrid { marker_mm } => {
            // The border's inner corner is √2 border widths away, the next tag and the far sides of a black square the gap.
            let gap = 0.9 * (target.spacing_mm - marker_mm);
            let axes = [[x, y], [y, [-1.0, 0.0]], [[-1.0, 0.0], [0.0, -1.0]], [[0.0, -1.0], x]][index % 4];
            let on_paper = (1.3 * marker_mm / CELLS[0]).min(gap);
            let between = (2.0 * 1.3 * marker_mm / CELLS[1]).min(gap);
            vec![
                Appearance { shape: Shape::Corner, axes, half: on_paper },
                Appearance { shape: Shape::Crossing, axes, half: between },
            ]
        }
        Pattern::Several { ref boards } => {
            let mut left = index;
            for part in boards {
                if left < part.board.len() {
                    return appearances(&part.board, left, options);
                }
                left -= part.board.len();
            }
            Vec::new()
        }
        Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => Vec::new(),
    }
}
