//! OpenCV's sector-based chessboard detector (Duda and Frese 2018).

use depthcal_model::target::Target;
use opencv::core::{Point2f, Size, Vector};

use super::context::Context;
use super::image::{to_mat, unscaled};
use crate::error::DetectError;
use crate::stretch::Plane;

// OpenCV 5 has moved the detector.
opencv::not_opencv_branch_5! { use opencv::calib3d as detectors; }
opencv::opencv_branch_5! { use opencv::objdetect as detectors; }

/// How thoroughly the detector searches.
#[derive(Clone, Copy)]
pub(crate) enum Effort {
    /// OpenCV's default.
    Quick,
    /// With the image normalised and every candidate followed.
    Exhaustive,
}

impl Effort {
    fn flags(self) -> i32 {
        match self {
            Effort::Quick => 0,
            Effort::Exhaustive => detectors::CALIB_CB_NORMALIZE_IMAGE | detectors::CALIB_CB_EXHAUSTIVE,
        }
    }
}

/// All corners of the board (px, in OpenCV's order), searched in the image enlarged `scale` times; `None` when not all
/// are found.
pub(crate) fn corners(
    plane: &Plane,
    target: &Target,
    scale: usize,
    effort: Effort,
) -> Result<Option<Vec<[f64; 2]>>, DetectError> {
    let operation = "findChessboardCornersSB";
    let scaled = to_mat(plane, scale)?;
    let mut corners = Vector::<Point2f>::new();
    let size = Size::new(target.columns as i32, target.rows as i32);
    let is_found =
        detectors::find_chessboard_corners_sb(&scaled, size, &mut corners, effort.flags()).context(operation)?;
    let complete = is_found && corners.len() == target.len();
    Ok(complete.then(|| corners.iter().map(|p| unscaled(p, scale)).collect()))
}
