//! OpenCV's reader of tags: contrib's `aruco` until 4.6, `objdetect` since 4.7.

use opencv::core::{MatTraitConst, Point2f, ToInputArray, Vector};

use super::context::Context;
use super::image::{to_mat, unscaled};
use crate::error::DetectError;
use crate::stretch::Plane;

/// A tag that was read: its number and its corners (px), clockwise from the tag's own top left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tag {
    pub(crate) id: usize,
    pub(crate) corners: [[f64; 2]; 4],
}

/// How tags are read.
#[cfg_attr(fiducials = "none", allow(dead_code))]
pub(crate) struct Reading {
    /// OpenCV's number of the dictionary.
    pub(crate) dictionary: i32,
    /// Width of a tag's black border in bits.
    pub(crate) border_bits: i32,
    /// Enlargement of the image; the bits of small tags are resolved only when it is above 1.
    pub(crate) scale: usize,
}

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

    pub(crate) fn dictionary_size(number: i32) -> Result<usize, DetectError> {
        Ok(dictionary(number)?.bytes_list().rows().max(0) as usize)
    }

    pub(super) fn draw(number: i32, id: i32) -> Result<Mat, DetectError> {
        let dictionary = dictionary(number)?;
        let mut drawn = Mat::default();
        aruco::draw_marker(&dictionary, id, dictionary.marker_size() + 2, &mut drawn, 1)
            .context("aruco::drawMarker")?;
        Ok(drawn)
    }

    pub(super) fn detect(
        mat: &impl ToInputArray,
        reading: &Reading,
        corners: &mut Vector<Vector<Point2f>>,
        ids: &mut Vector<i32>,
    ) -> Result<(), DetectError> {
        let operation = "aruco::detectMarkers";
        let mut parameters = aruco::DetectorParameters::create().context(operation)?;
        parameters.set_marker_border_bits(reading.border_bits);
        let mut rejected = opencv::core::no_array();
        aruco::detect_markers(mat, &dictionary(reading.dictionary)?, corners, ids, &parameters, &mut rejected)
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

    pub(crate) fn dictionary_size(number: i32) -> Result<usize, DetectError> {
        Ok(dictionary(number)?.bytes_list().rows().max(0) as usize)
    }

    pub(super) fn draw(number: i32, id: i32) -> Result<Mat, DetectError> {
        let dictionary = dictionary(number)?;
        let mut drawn = Mat::default();
        dictionary
            .generate_image_marker(id, dictionary.marker_size() + 2, &mut drawn, 1)
            .context("Dictionary::generateImageMarker")?;
        Ok(drawn)
    }

    pub(super) fn detect(
        mat: &impl ToInputArray,
        reading: &Reading,
        corners: &mut Vector<Vector<Point2f>>,
        ids: &mut Vector<i32>,
    ) -> Result<(), DetectError> {
        let operation = "ArucoDetector::detectMarkers";
        let mut parameters = objdetect::DetectorParameters::default().context(operation)?;
        parameters.set_marker_border_bits(reading.border_bits);
        let refine = objdetect::RefineParameters::new_def().context(operation)?;
        let detector =
            objdetect::ArucoDetector::new(&dictionary(reading.dictionary)?, &parameters, refine).context(operation)?;
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

    pub(crate) fn dictionary_size(_: i32) -> Result<usize, DetectError> {
        Err(missing())
    }

    pub(super) fn draw(_: i32, _: i32) -> Result<Mat, DetectError> {
        Err(missing())
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

pub(crate) use implementation::dictionary_size;

/// The cells of tag `id` of a dictionary, row by row, with its black border of one cell: whether each is white.
pub(crate) fn tag_cells(dictionary: i32, id: usize) -> Result<Vec<Vec<bool>>, DetectError> {
    let drawn = implementation::draw(dictionary, id as i32)?;
    let cell = |row, column| drawn.at_2d::<u8>(row, column).map(|v| *v > 127).context("Mat::at");
    (0..drawn.rows()).map(|row| (0..drawn.cols()).map(|column| cell(row, column)).collect()).collect()
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
