//! The methods of finding a chessboard's corners, in the order in which they are tried.

use depthcal_model::target::Target;

use super::saddles;
use crate::detection::Detector;
use crate::error::DetectError;
#[cfg(feature = "opencv")]
use crate::open_cv::sectors::{self, Effort};
use crate::stretch::Plane;

/// A method of finding corners.
#[derive(Clone, Copy)]
pub(super) enum Attempt {
    /// Saddle points of the smoothed image.
    Saddles,
    /// OpenCV's detector in the image enlarged this many times.
    #[cfg(feature = "opencv")]
    Sectors(usize, Effort),
    /// OpenCV was asked for and is not there.
    #[cfg(not(feature = "opencv"))]
    Missing,
}

/// The cheap and successful ones first.
pub(super) fn attempts(detector: Detector) -> Vec<Attempt> {
    match detector {
        Detector::BuiltIn => vec![Attempt::Saddles],
        #[cfg(feature = "opencv")]
        Detector::OpenCv => vec![
            Attempt::Sectors(1, Effort::Quick),
            Attempt::Saddles,
            Attempt::Sectors(2, Effort::Quick),
            Attempt::Sectors(1, Effort::Exhaustive),
        ],
        #[cfg(not(feature = "opencv"))]
        Detector::OpenCv => vec![Attempt::Missing],
    }
}

impl Attempt {
    /// All corners of the board, in the order of one of its labellings.
    pub(super) fn corners(self, plane: &Plane, target: &Target) -> Result<Option<Vec<[f64; 2]>>, DetectError> {
        match self {
            Attempt::Saddles => Ok(saddles::find(plane, target)),
            #[cfg(feature = "opencv")]
            Attempt::Sectors(scale, _) if scale > 1 && !plane.is_small() => Ok(None),
            #[cfg(feature = "opencv")]
            Attempt::Sectors(scale, effort) => sectors::corners(plane, target, scale, effort),
            #[cfg(not(feature = "opencv"))]
            Attempt::Missing => Err(DetectError::MissingFeature { feature: "opencv" }),
        }
    }
}
