//! Tags of an image, by the reader that is asked for.

use crate::detection::{DetectOptions, Detector};
use crate::error::DetectError;
use crate::stretch::Plane;
use crate::tags::{Reading, Tag};

/// Reads all tags in an image whose numbers are not below that of the board's first, from which they are then counted.
pub(super) fn read_tags(plane: &Plane, reading: &Reading, options: &DetectOptions) -> Result<Vec<Tag>, DetectError> {
    let tags = match options.detector {
        Detector::BuiltIn => crate::tags::read_tags(plane, reading),
        Detector::OpenCv => by_opencv(plane, reading)?,
    };
    let counted = |tag: Tag| Some(Tag { id: tag.id.checked_sub(options.first_tag)?, ..tag });
    Ok(tags.into_iter().filter_map(counted).collect())
}

#[cfg(feature = "opencv")]
fn by_opencv(plane: &Plane, reading: &Reading) -> Result<Vec<Tag>, DetectError> {
    crate::open_cv::tags::read_tags(plane, reading)
}

#[cfg(not(feature = "opencv"))]
fn by_opencv(_: &Plane, _: &Reading) -> Result<Vec<Tag>, DetectError> {
    Err(DetectError::MissingFeature { feature: "opencv" })
}
