//! ChArUco boards: the tags locate the board, and the crossings of its chessboard are the markers.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

use super::attempts::attempts;
use super::consistent::consistent;
use super::dictionary::dictionary_number;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::DetectError;
use crate::geometry::{Homography, Pair};
use crate::open_cv::tags::{Reading, Tag, dictionary_size, read_tags};
use crate::refine::{RefineOptions, homography_mapping, refine_corners};

/// Largest distance of a fitted crossing from the position that the tags predict, in squares.
const TOLERANCE: f64 = 0.15;

/// Column and row of the square that carries tag `id`; `None` when the board has fewer tags. Tags are numbered row by
/// row over the white squares. `first_white` is the column of the first white square: 1 when the top left square is
/// black, as in OpenCV since 4.6 and, for an odd number of rows, before.
fn square_of(id: usize, columns: usize, rows: usize, first_white: usize) -> Option<[usize; 2]> {
    let mut left = id;
    for row in 0..rows {
        let start = (row + first_white) % 2;
        let count = columns.saturating_sub(start).div_ceil(2);
        if left < count {
            return Some([start + 2 * left, row]);
        }
        left -= count;
    }
    None
}

/// Searches an image for a ChArUco board.
pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    dictionary: &str,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    let Pattern::Charuco { marker_mm, .. } = target.pattern else { return Ok(None) };
    let number = dictionary_number(dictionary)?;
    let (need, got) = (target.columns * target.rows / 2, dictionary_size(number)?);
    if got < need {
        return Err(DetectError::DictionaryTooSmall { dictionary: dictionary.to_owned(), need, got });
    }
    let margin = (target.spacing_mm - marker_mm) / 2.0;
    let corners_of = |id: usize, first_white: usize| {
        let [column, row] = square_of(id, target.columns, target.rows, first_white)?;
        let low = [column as f64 * target.spacing_mm + margin, row as f64 * target.spacing_mm + margin];
        let high = [low[0] + marker_mm, low[1] + marker_mm];
        Some([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    };
    let mut best: Option<Detection> = None;
    for (plane, scale) in attempts(image) {
        let tags = read_tags(&plane, &Reading { dictionary: number, border_bits: 1, scale })?;
        // Boards with an even number of rows begin with a white square when drawn by OpenCV before 4.6.
        let layouts: &[usize] = if target.rows.is_multiple_of(2) { &[1, 0] } else { &[1] };
        let layout = layouts
            .iter()
            .map(|&first| (first, consistent(tags.clone(), |id| corners_of(id, first), 0.2)))
            .max_by_key(|(first, kept)| (kept.len(), *first));
        let Some((first_white, kept)) = layout else { continue };
        let markers = predict(&kept, target, |id| corners_of(id, first_white));
        let mut detection = Detection { markers, polarity: Polarity::DarkOnBright };
        if options.refine {
            detection = settle(image, detection, target)?;
        }
        if best.as_ref().is_none_or(|b| b.markers.len() < detection.markers.len()) {
            best = Some(detection);
        }
        if best.as_ref().is_some_and(|b| 10 * b.markers.len() >= 9 * target.len()) {
            break;
        }
    }
    Ok(best.filter(|b| b.markers.len() >= options.min_markers.max(4)))
}

/// Positions of the crossings, each predicted from the nearest tags; crossings without a tag next to them are left out.
fn predict(tags: &[Tag], target: &Target, corners_of: impl Fn(usize) -> Option<[[f64; 2]; 4]>) -> Vec<Marker> {
    let mut markers = Vec::new();
    for index in 0..target.len() {
        let p = target.point(index);
        let mut near: Vec<(f64, Vec<Pair>)> = tags
            .iter()
            .filter_map(|tag| {
                let board = corners_of(tag.id)?;
                let middle = [(board[0][0] + board[2][0]) / 2.0, (board[0][1] + board[2][1]) / 2.0];
                let distance = (middle[0] - p[0]).hypot(middle[1] - p[1]) / target.spacing_mm;
                (distance < 2.0).then(|| (distance, board.into_iter().zip(tag.corners).collect()))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        // A crossing touches two white squares; when no tag was read in either it is hidden or unclear.
        if near.first().is_none_or(|n| n.0 > 0.8) {
            continue;
        }
        let pairs: Vec<_> = near.into_iter().take(4).flat_map(|n| n.1).collect();
        if let Some(pixel) = Homography::fit(&pairs).and_then(|map| map.apply(p)) {
            markers.push(Marker { index, pixel });
        }
    }
    markers
}

/// Fits the crossings and drops those that cannot be fitted or end away from their predicted position.
fn settle(image: &GrayImage, mut detection: Detection, target: &Target) -> Result<Detection, DetectError> {
    let refined = refine_corners(image, &detection, target, &RefineOptions::default())?;
    let map = homography_mapping(&detection, target);
    let before = detection.clone();
    detection.markers = refined
        .iter()
        .filter(|r| {
            let Some(at) = before.markers.iter().find(|m| m.index == r.index).map(|m| m.pixel) else { return false };
            let p = target.point(r.index);
            let step = map.as_ref().and_then(|map| {
                let (a, x) = (map.apply(p)?, map.apply([p[0] + target.spacing_mm, p[1]])?);
                let y = map.apply([p[0], p[1] + target.spacing_mm])?;
                Some((x[0] - a[0]).hypot(x[1] - a[1]).min((y[0] - a[0]).hypot(y[1] - a[1])))
            });
            step.is_some_and(|step| (r.pixel[0] - at[0]).hypot(r.pixel[1] - at[1]) < TOLERANCE * step + 0.3)
        })
        .map(|r| Marker { index: r.index, pixel: r.pixel })
        .collect();
    Ok(detection)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_numbered_through_the_white_squares() {
        // Black top left: the first tag is in the second square.
        assert_eq!(square_of(0, 5, 4, 1), Some([1, 0]));
        assert_eq!(square_of(1, 5, 4, 1), Some([3, 0]));
        assert_eq!(square_of(2, 5, 4, 1), Some([0, 1]));
        assert_eq!(square_of(0, 5, 4, 0), Some([0, 0]));
        assert_eq!(square_of(10, 5, 4, 1), None);
    }
}
