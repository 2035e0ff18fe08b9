//! Grids of AprilTags of the family 36h11.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;

use super::attempts::attempts;
use super::consistent::consistent;
use super::extend::extend;
use super::reader::read_tags;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::DetectError;
use crate::tags::dictionary::Dictionary;
use crate::tags::{Reading, Tag};

const DICTIONARY: &str = "DICT_APRILTAG_36H11";

/// Searches an image for an AprilGrid.
pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    let need = target.columns * target.rows;
    let dictionary = Dictionary::with_tags(DICTIONARY, options.first_tag + need)?;
    let corners_of = |id: usize| (id < need).then(|| [0, 1, 2, 3].map(|corner| target.point(4 * id + corner)));
    let mut best: Vec<Tag> = Vec::new();
    for (plane, scale) in attempts(image) {
        // Most generators print a border of one bit, Kalibr one of two.
        for border in [1, 2] {
            let reading = Reading { dictionary: &dictionary, border, scale };
            let tags = read_tags(&plane, &reading, options)?;
            let candidate = consistent(tags, corners_of, 0.2);
            if candidate.len() > best.len() {
                best = candidate;
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
    let mut detection = Detection { markers, polarity: Polarity::DarkOnBright, charuco_layout: None };
    if detection.markers.len() < options.min_markers.max(4) {
        return Ok(None);
    }
    if options.refine {
        // The corners of tags whose
        // bits could not be read follow from those around them.
        detection.markers = extend(image, target, &detection.markers);
    }
    Ok((detection.markers.len() >= options.min_markers.max(4)).then_some(detection))
}
