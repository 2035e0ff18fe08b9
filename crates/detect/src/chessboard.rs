//! Chessboards: found by OpenCV's sector-based detector (Duda and Frese 2018), put in order, crossings fitted.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Size, Vector};

use crate::circles::upright;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::{Context, DetectError};
use crate::geometry::BoardMap;
use crate::refine::{self, RefineOptions};
use crate::stretch::{Plane, Stretch};

/// Largest rms distance of the corners from a smooth map, in squares.
const MAX_RMS: f64 = 0.08;

pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    // Quick attempts with every stretch first, thorough ones only when all of them fail.
    for flags in [0, calib3d::CALIB_CB_NORMALIZE_IMAGE | calib3d::CALIB_CB_EXHAUSTIVE] {
        for &stretch in Stretch::candidates(image) {
            let plane = Plane::stretched(image, stretch);
            let Some(corners) = corners(&plane, target, flags)? else { continue };
            let Some(markers) = in_order(&corners, target, &plane) else { continue };
            let mut detection = Detection { markers, polarity: Polarity::DarkOnBright };
            if options.refine {
                let refined = refine::refine_corners(image, &detection, target, &RefineOptions::default())?;
                refine::take_over(&mut detection, &refined);
            }
            return Ok(Some(detection));
        }
    }
    Ok(None)
}

/// OpenCV's corners in OpenCV's order.
fn corners(plane: &Plane, target: &Target, flags: i32) -> Result<Option<Vec<[f64; 2]>>, DetectError> {
    let operation = "findChessboardCornersSB";
    let bytes = plane.to_bytes();
    let mat = Mat::new_rows_cols_with_data(plane.height as i32, plane.width as i32, &bytes).context(operation)?;
    let mut corners = Vector::<Point2f>::new();
    let size = Size::new(target.columns as i32, target.rows as i32);
    let found = calib3d::find_chessboard_corners_sb(&mat, size, &mut corners, flags).context(operation)?;
    let complete = found && corners.len() == target.len();
    Ok(complete.then(|| corners.iter().map(|p| [f64::from(p.x), f64::from(p.y)]).collect()))
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
            let dark = starts_dark(&map, target, plane);
            Some((dark, upright(target, |p| map.apply(p))?, order))
        })
        .max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
        .map(|(_, _, order)| order.into_iter().enumerate().map(|(index, pixel)| Marker { index, pixel }).collect())
}

/// Whether the squares of the first one's colour are the dark ones.
fn starts_dark(map: &BoardMap, target: &Target, plane: &Plane) -> bool {
    let mut balance = 0.0;
    for i in 0..target.rows - 1 {
        for j in 0..target.columns - 1 {
            let middle = [(j as f64 + 0.5) * target.spacing_mm, (i as f64 + 0.5) * target.spacing_mm];
            let Some([u, v]) = map.apply(middle) else { continue };
            let (x, y) = (u.round(), v.round());
            if x >= 0.0 && y >= 0.0 && (x as usize) < plane.width && (y as usize) < plane.height {
                let value = f64::from(plane.data[y as usize * plane.width + x as usize]);
                balance += if (i + j) % 2 == 0 { value } else { -value };
            }
        }
    }
    // Boards with an odd number of squares have one colour more often; a constant does not decide.
    let squares = (target.rows - 1) * (target.columns - 1);
    if squares % 2 == 1 {
        let mean = plane.data.iter().map(|&v| f64::from(v)).sum::<f64>() / plane.data.len() as f64;
        balance -= mean;
    }
    balance < 0.0
}
