//! Tags of an image, by the reader that is asked for.

use crate::detection::Detector;
use crate::error::DetectError;
use crate::stretch::Plane;
use crate::tags::{Reading, Tag};

/// Reads all tags of a board in an image.
pub(super) fn read_tags(plane: &Plane, reading: &Reading, detector: Detector) -> Result<Vec<Tag>, DetectError> {
    match detector {
        Detector::BuiltIn => Ok(crate::tags::read_tags(plane, reading)),
        Detector::OpenCv => by_opencv(plane, reading),
    }
}

#[cfg(feature = "opencv")]
fn by_opencv(plane: &Plane, reading: &Reading) -> Result<Vec<Tag>, DetectError> {
    crate::open_cv::tags::read_tags(plane, reading)
}

#[cfg(not(feature = "opencv"))]
fn by_opencv(_: &Plane, _: &Reading) -> Result<Vec<Tag>, DetectError> {
    Err(DetectError::MissingFeature { feature: "opencv" })
}
