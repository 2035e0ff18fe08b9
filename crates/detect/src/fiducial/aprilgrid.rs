//! Grids of AprilTags of the family 36h11.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

use super::attempts::attempts;
use super::consistent::consistent;
use super::dictionary::dictionary_number;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::DetectError;
use crate::open_cv::tags::{Reading, Tag, dictionary_size, read_tags};
use crate::refine::clear::{keep_clear, take_over};
use crate::refine::{RefineOptions, homography_mapping, refine_corners};

const DICTIONARY: &str = "DICT_APRILTAG_36H11";
/// Largest distance of a fitted corner from its position on the board, in sides of a tag: half a bit.
const PLACE_TOLERANCE: f64 = 0.06;

/// Searches an image for an AprilGrid.
pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    let number = dictionary_number(DICTIONARY)?;
    let (need, got) = (target.columns * target.rows, dictionary_size(number)?);
    if got < need {
        return Err(DetectError::DictionaryTooSmall { dictionary: DICTIONARY.to_owned(), need, got });
    }
    let corners_of = |id: usize| (id < need).then(|| [0, 1, 2, 3].map(|corner| target.point(4 * id + corner)));
    let mut best: Vec<Tag> = Vec::new();
    for (plane, scale) in attempts(image) {
        // Most generators print a border of one bit, Kalibr one of two.
        for border_bits in [1, 2] {
            let tags = read_tags(&plane, &Reading { dictionary: number, border_bits, scale })?;
            let kept = consistent(tags, corners_of, 0.2);
            if kept.len() > best.len() {
                best = kept;
            }
        }
        if 10 * best.len() >= 9 * need {
            break;
        }
    }
    let markers: Vec<Marker> = best
        .iter()
        .flat_map(|tag| {
            tag.corners.into_iter().enumerate().map(|(corner, pixel)| Marker { index: 4 * tag.id + corner, pixel })
        })
        .collect();
    let mut detection = Detection { markers, polarity: Polarity::DarkOnBright };
    if detection.markers.len() < options.min_markers.max(4) {
        return Ok(None);
    }
    if options.refine {
        // OpenCV's corners are bends of the thresholded tag's contour, accurate to half a pixel.
        let refined = refine_corners(image, &detection, target, &RefineOptions::default())?;
        take_over(&mut detection, &refined);
        complete(image, &mut detection, target)?;
    }
    Ok((detection.markers.len() >= options.min_markers.max(4)).then_some(detection))
}

/// Adds the corners of tags whose bits could not be read, at the positions that the tags that were read predict. All
/// corners are then fitted; those that end away from their position on the board are dropped.
fn complete(image: &GrayImage, detection: &mut Detection, target: &Target) -> Result<(), DetectError> {
    let Pattern::Aprilgrid { marker_mm } = target.pattern else { return Ok(()) };
    let (width, height) = (image.width as f64, image.height as f64);
    // Twice, as the second map is fitted to more corners.
    for last in [false, true] {
        let Some(map) = homography_mapping(detection, target) else { return Ok(()) };
        let predicted = |index: usize| {
            let [x, y] = target.point(index);
            let at = map.apply([x, y])?;
            let (a, b) = (map.apply([x + marker_mm, y])?, map.apply([x, y + marker_mm])?);
            let side = (a[0] - at[0]).hypot(a[1] - at[1]).min((b[0] - at[0]).hypot(b[1] - at[1]));
            let inside = at[0] > 0.0 && at[1] > 0.0 && at[0] < width - 1.0 && at[1] < height - 1.0;
            inside.then_some((at, side))
        };
        for index in 0..target.len() {
            if let Err(place) = detection.markers.binary_search_by_key(&index, |m| m.index)
                && let Some((pixel, _)) = predicted(index)
            {
                detection.markers.insert(place, Marker { index, pixel });
            }
        }
        let mut refined = refine_corners(image, detection, target, &RefineOptions::default())?;
        refined.retain(|r| {
            predicted(r.index).is_some_and(|(at, side)| {
                (r.pixel[0] - at[0]).hypot(r.pixel[1] - at[1]) < PLACE_TOLERANCE * side + 2.5 * map.rms_px()
            })
        });
        detection.markers.retain(|m| refined.iter().any(|r| r.index == m.index));
        if last { keep_clear(detection, &refined) } else { take_over(detection, &refined) }
    }
    Ok(())
}
