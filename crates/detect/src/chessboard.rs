//! Chessboards: found by OpenCV's sector-based detector (Duda and Frese 2018) or, where that fails, by their saddle
//! points; put in order, crossings fitted.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use opencv::core::{Point2f, Size, Vector};

use crate::circles::upright;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::{Context, DetectError};
use crate::geometry::BoardMap;
use crate::refine::{self, RefineOptions};
use crate::saddles;
use crate::stretch::{Plane, Stretch, unscaled};

// OpenCV 5 has moved the detector.
opencv::not_opencv_branch_5! { use opencv::calib3d as detectors; }
opencv::opencv_branch_5! { use opencv::objdetect as detectors; }

/// Largest rms distance of the corners from a smooth map, in squares.
const MAX_RMS: f64 = 0.08;
/// Part of the pairs of neighbouring squares that alternate, less the part that does not.
const MIN_ALTERNATION: f64 = 0.8;

/// A way to look for corners.
#[derive(Clone, Copy)]
enum Attempt {
    /// OpenCV's detector at a scale of the image, with flags.
    Sectors(usize, i32),
    /// Own code.
    Saddles,
}

/// By price and success.
const ATTEMPTS: [Attempt; 4] = [
    Attempt::Sectors(1, 0),
    Attempt::Saddles,
    Attempt::Sectors(2, 0),
    Attempt::Sectors(1, detectors::CALIB_CB_NORMALIZE_IMAGE | detectors::CALIB_CB_EXHAUSTIVE),
];

pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    let planes: Vec<Plane> = Stretch::candidates(image).iter().map(|&s| Plane::stretched(image, s)).collect();
    for attempt in ATTEMPTS {
        for plane in &planes {
            let corners = match attempt {
                Attempt::Sectors(scale, _) if scale > 1 && !plane.is_small() => None,
                Attempt::Sectors(scale, flags) => sector_corners(plane, target, scale, flags)?,
                Attempt::Saddles => saddles::find(plane, target),
            };
            let Some(markers) = corners.and_then(|corners| in_order(&corners, target, plane)) else { continue };
            let mut detection = Detection { markers, polarity: Polarity::DarkOnBright };
            if options.refine {
                sharpen(image, &mut detection, target)?;
            }
            return Ok(Some(detection));
        }
    }
    Ok(None)
}

/// Replaces OpenCV's corners by fitted crossings. Where one was fitted elsewhere than its neighbours say, from a start
/// that was off, it is fitted again from there.
fn sharpen(image: &GrayImage, detection: &mut Detection, target: &Target) -> Result<(), DetectError> {
    let options = RefineOptions::default();
    for _ in 0..2 {
        let refined = refine::refine_corners(image, detection, target, &options)?;
        refine::take_over(detection, &refined);
        let Some(map) = refine::homography_mapping(detection, target) else { break };
        let limit = 2.5 * map.rms_px();
        let mut strays = detection.clone();
        strays.markers.retain_mut(|marker| {
            let Some(place) = map.apply(target.point(marker.index)) else { return false };
            let distance = (place[0] - marker.pixel[0]).hypot(place[1] - marker.pixel[1]);
            marker.pixel = place;
            distance > limit
        });
        if strays.markers.is_empty() {
            break;
        }
        for stray in strays.markers {
            detection.markers[stray.index].pixel = stray.pixel;
        }
    }
    let refined = refine::refine_corners(image, detection, target, &options)?;
    refine::keep_clear(detection, &refined);
    Ok(())
}

/// OpenCV's corners in OpenCV's order, looked for at `scale` times the size of the image.
fn sector_corners(
    plane: &Plane,
    target: &Target,
    scale: usize,
    flags: i32,
) -> Result<Option<Vec<[f64; 2]>>, DetectError> {
    let operation = "findChessboardCornersSB";
    let scaled = plane.to_mat(scale)?;
    let mut corners = Vector::<Point2f>::new();
    let size = Size::new(target.columns as i32, target.rows as i32);
    let found = detectors::find_chessboard_corners_sb(&scaled, size, &mut corners, flags).context(operation)?;
    let complete = found && corners.len() == target.len();
    Ok(complete.then(|| corners.iter().map(|p| unscaled(p, scale)).collect()))
}

/// OpenCV starts from any end of the board. Chooses, among the labellings that are a rotation of the board and not a
/// mirror image, the one with the dark square at its start, and among several of these the most upright.
fn in_order(corners: &[[f64; 2]], target: &Target, plane: &Plane) -> Option<Vec<Marker>> {
    let (columns, rows) = (target.columns, target.rows);
    let mut candidates: Vec<Vec<[f64; 2]>> = Vec::new();
    let forward = corners.to_vec();
    let mirrored: Vec<_> =
        (0..corners.len()).map(|i| corners[i / columns * columns + columns - 1 - i % columns]).collect();
    for order in [forward, mirrored] {
        let mut turned = order.clone();
        turned.reverse();
        if columns == rows {
            let quarter: Vec<_> =
                (0..order.len()).map(|i| order[(rows - 1 - i % columns) * columns + i / columns]).collect();
            let mut three_quarters = quarter.clone();
            three_quarters.reverse();
            candidates.extend([quarter, three_quarters]);
        }
        candidates.extend([order, turned]);
    }
    candidates
        .into_iter()
        .filter_map(|order| {
            let pairs: Vec<_> = order.iter().enumerate().map(|(i, &p)| (target.point(i), p)).collect();
            let map = BoardMap::fit(&pairs)?;
            let origin = map.apply([0.0, 0.0])?;
            let (x, y) = (map.apply([target.spacing_mm, 0.0])?, map.apply([0.0, target.spacing_mm])?);
            let (x, y) = ([x[0] - origin[0], x[1] - origin[1]], [y[0] - origin[0], y[1] - origin[1]]);
            let step = x[0].hypot(x[1]).min(y[0].hypot(y[1]));
            if x[0] * y[1] - x[1] * y[0] <= 0.0 || map.rms_px() > MAX_RMS * step + 0.3 {
                return None;
            }
            let dark = starts_dark(&map, target, plane)?;
            Some((dark, upright(target, |p| map.apply(p))?, order))
        })
        .max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
        .map(|(_, _, order)| order.into_iter().enumerate().map(|(index, pixel)| Marker { index, pixel }).collect())
}

/// Whether the squares of the first one's colour are the dark ones; `None` when the squares do not alternate, and it is
/// no chessboard.
fn starts_dark(map: &BoardMap, target: &Target, plane: &Plane) -> Option<bool> {
    let (mut agree, mut compared) = (0i32, 0i32);
    let grey = |j: usize, i: usize| {
        let [u, v] = map.apply([(j as f64 + 0.5) * target.spacing_mm, (i as f64 + 0.5) * target.spacing_mm])?;
        let (x, y) = (u.round(), v.round());
        let inside = x >= 0.0 && y >= 0.0 && (x as usize) < plane.width && (y as usize) < plane.height;
        inside.then(|| plane.data[y as usize * plane.width + x as usize])
    };
    // Neighbours are compared, so that uneven light does not matter.
    for i in 0..target.rows - 1 {
        for j in 0..target.columns - 1 {
            for (k, l) in [(j + 1, i), (j, i + 1)] {
                if k + 1 >= target.columns || l + 1 >= target.rows {
                    continue;
                }
                let (Some(a), Some(b)) = (grey(j, i), grey(k, l)) else { continue };
                let first_is_darker = if (i + j) % 2 == 0 { a < b } else { b < a };
                agree += if first_is_darker { 1 } else { -1 };
                compared += 1;
            }
        }
    }
    (f64::from(agree.abs()) > MIN_ALTERNATION * f64::from(compared)).then_some(agree > 0)
}
