//! Grids of AprilTags of the family 36h11.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;

use super::backend::{Reading, dictionary_size, read_tags};
use super::{Tag, consistent, dictionary_number};
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::DetectError;
use crate::stretch::{Plane, Stretch};

const DICTIONARY: &str = "DICT_APRILTAG_36H11";

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
    for &stretch in Stretch::candidates(image) {
        let plane = Plane::stretched(image, stretch);
        // Tags are printed with a border of one bit by most and of two by Kalibr.
        for border_bits in [1, 2] {
            let tags = read_tags(&plane, &Reading { dictionary: number, border_bits, refine: options.refine })?;
            let kept = consistent(tags, corners_of, 0.2);
            if kept.len() > best.len() {
                best = kept;
            }
        }
        if 2 * best.len() > need {
            break;
        }
    }
    let markers: Vec<Marker> = best
        .iter()
        .flat_map(|tag| {
            tag.corners.into_iter().enumerate().map(|(corner, pixel)| Marker { index: 4 * tag.id + corner, pixel })
        })
        .collect();
    let enough = markers.len() >= options.min_markers.max(4);
    Ok(enough.then_some(Detection { markers, polarity: Polarity::DarkOnBright }))
}
