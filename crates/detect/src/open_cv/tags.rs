//! OpenCV's reader of tags: contrib's `aruco` until 4.6, `objdetect` since 4.7.

use opencv::core::{Point2f, ToInputArray, Vector};

use super::image::{to_mat, unscaled};
use crate::error::DetectError;
use crate::stretch::Plane;
use crate::tags::{Reading, Tag};

#[cfg(fiducials = "contrib")]
mod implementation {
    use opencv::aruco;
    use opencv::core::Ptr;
    use opencv::prelude::*;

    use super::*;
    use crate::open_cv::context::Context;

    fn dictionary(number: i32) -> Result<Ptr<aruco::Dictionary>, DetectError> {
        aruco::get_predefined_dictionary_i32(number).context("getPredefinedDictionary")
    }

    pub(super) fn detect(
        mat: &impl ToInputArray,
        reading: &Reading,
        corners: &mut Vector<Vector<Point2f>>,
        ids: &mut Vector<i32>,
    ) -> Result<(), DetectError> {
        let operation = "aruco::detectMarkers";
        let mut parameters = aruco::DetectorParameters::create().context(operation)?;
        parameters.set_marker_border_bits(reading.border as i32);
        let mut rejected = opencv::core::no_array();
        aruco::detect_markers(mat, &dictionary(reading.dictionary.number)?, corners, ids, &parameters, &mut rejected)
            .context(operation)
    }
}

#[cfg(fiducials = "objdetect")]
mod implementation {
    use opencv::objdetect;
    use opencv::prelude::*;

    use super::*;
    use crate::open_cv::context::Context;

    fn dictionary(number: i32) -> Result<objdetect::Dictionary, DetectError> {
        objdetect::get_predefined_dictionary_i32(number).context("getPredefinedDictionary")
    }

    pub(super) fn detect(
        mat: &impl ToInputArray,
        reading: &Reading,
        corners: &mut Vector<Vector<Point2f>>,
        ids: &mut Vector<i32>,
    ) -> Result<(), DetectError> {
        let operation = "ArucoDetector::detectMarkers";
        let mut parameters = objdetect::DetectorParameters::default().context(operation)?;
        parameters.set_marker_border_bits(reading.border as i32);
        let refine = objdetect::RefineParameters::new_def().context(operation)?;
        let detector = objdetect::ArucoDetector::new(&dictionary(reading.dictionary.number)?, &parameters, refine)
            .context(operation)?;
        let mut rejected = opencv::core::no_array();
        detector.detect_markers(mat, corners, ids, &mut rejected).context(operation)
    }
}

#[cfg(fiducials = "none")]
mod implementation {
    use opencv::core::Mat;

    use super::*;

    fn missing() -> DetectError {
        DetectError::MissingModule {
            module: "the reader of ArUco and AprilTag markers",
            version: opencv::core::CV_VERSION,
            remedy: "build with an OpenCV that has the contrib module aruco, or with 4.7 or later",
        }
    }

    pub(super) fn detect(
        _: &impl ToInputArray,
        _: &Reading,
        _: &mut Vector<Vector<Point2f>>,
        _: &mut Vector<i32>,
    ) -> Result<(), DetectError> {
        Err(missing())
    }
}

/// Reads all tags of a dictionary in an image.
pub(crate) fn read_tags(plane: &Plane, reading: &Reading) -> Result<Vec<Tag>, DetectError> {
    let mat = to_mat(plane, reading.scale)?;
    let mut corners = Vector::<Vector<Point2f>>::new();
    let mut ids = Vector::<i32>::new();
    implementation::detect(&mat, reading, &mut corners, &mut ids)?;
    let tags = corners.iter().zip(ids.iter()).filter_map(|(quad, id)| {
        let points: Vec<[f64; 2]> = quad.iter().map(|p| unscaled(p, reading.scale)).collect();
        Some(Tag { id: usize::try_from(id).ok()?, corners: points.try_into().ok()? })
    });
    Ok(tags.collect())
}
