//! Grids of AprilTags of the family 36h11.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;

use super::attempts::attempts;
use super::consistent::consistent;
use super::dictionary::dictionary_number;
use super::extend::extend;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::DetectError;
use crate::open_cv::tags::{Reading, Tag, dictionary_size, read_tags};

const DICTIONARY: &str = "DICT_APRILTAG_36H11";

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
        // OpenCV's corners are bends of the thresholded tag's contour, accurate to half a pixel. The corners of tags whose
        // bits could not be read follow from those around them.
        detection.markers = extend(image, target, &detection.markers);
    }
    Ok((detection.markers.len() >= options.min_markers.max(4)).then_some(detection))
}
