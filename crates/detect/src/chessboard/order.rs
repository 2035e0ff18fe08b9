//! The order of a chessboard's corners.

use depthcal_model::target::Target;

use crate::board::upright;
use crate::detection::Marker;
use crate::geometry::BoardMap;
use crate::stretch::Plane;

/// Largest rms distance of the corners from a smooth map, in squares.
const MAX_RMS: f64 = 0.08;
/// Least share of neighbouring pairs of squares that alternate, minus the share that does not.
const MIN_ALTERNATION: f64 = 0.8;

/// Assigns corners to markers. The corners may begin at any end of the board: of the labellings that are rotations of
/// the board, not mirror images, the one that begins at a dark square is taken, and of several such the most upright.
/// `None` when the corners fit no smooth map or lie on no chessboard.
pub(super) fn in_order(corners: &[[f64; 2]], target: &Target, plane: &Plane) -> Option<Vec<Marker>> {
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

/// Whether the board begins at a dark square; `None` when the squares do not alternate, and the pattern is no
/// chessboard.
fn starts_dark(map: &BoardMap, target: &Target, plane: &Plane) -> Option<bool> {
    let (mut agree, mut compared) = (0i32, 0i32);
    let grey = |j: usize, i: usize| {
        let [u, v] = map.apply([(j as f64 + 0.5) * target.spacing_mm, (i as f64 + 0.5) * target.spacing_mm])?;
        let (x, y) = (u.round(), v.round());
        let inside = x >= 0.0 && y >= 0.0 && (x as usize) < plane.width && (y as usize) < plane.height;
        inside.then(|| plane.data[y as usize * plane.width + x as usize])
    };
    // Neighbours are compared, which makes the result independent of uneven light.
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
