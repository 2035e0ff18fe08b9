//! What is found, and how it is asked for.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};
use serde::{Deserialize, Serialize};

use crate::error::DetectError;
use crate::{chessboard, circles, fiducial, refine, stretch};

/// A marker of the board in the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Index in the order of [`Target::point`].
    pub index: usize,
    /// Where it is, px; pixel centres have integer coordinates, as in OpenCV.
    pub pixel: [f64; 2],
}

/// Which of print and paper is darker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Polarity {
    /// Dark print on bright paper; all boards but circle grids.
    DarkOnBright,
    /// Bright dots on a dark board.
    BrightOnDark,
}

/// A board that was found in an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// The markers, by rising index. Circle grids and chessboards are complete but for a few that are hidden or unclear
    /// (a reflex); ChArUco boards and AprilGrids may be seen in part.
    pub markers: Vec<Marker>,
    /// Dark dots or bright ones.
    pub polarity: Polarity,
}

/// How to look for a board.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DetectOptions {
    /// Fit markers to the image with a model of what they look like: discs for circle grids, crossings for chessboards
    /// and ChArUco. Without it: centres of gravity, and OpenCV's corners.
    pub refine: bool,
    /// Fewest markers that make a detection of a ChArUco board or AprilGrid.
    pub min_markers: usize,
}

impl Default for DetectOptions {
    fn default() -> Self {
        DetectOptions { refine: true, min_markers: 8 }
    }
}

/// Looks for the board in an image.
///
/// `None` means that the board is not in the image, or not surely: a wrong grid is not returned. Boards that look the
/// same after a turn are labelled as upright as the image allows; a chessboard with an odd and an even number of rows
/// and columns is labelled so that the square before its first corner is dark.
///
/// # Errors
/// When the image is inconsistent, when the board is too small or unknown to OpenCV, or when OpenCV fails or lacks the
/// module that the board needs.
pub fn detect(image: &GrayImage, target: &Target, options: &DetectOptions) -> Result<Option<Detection>, DetectError> {
    stretch::check(image)?;
    check_target(target)?;
    match &target.pattern {
        Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => {
            let Some(mut detection) = circles::find(image, target) else { return Ok(None) };
            if options.refine {
                refine::sharpen_circles(image, &mut detection, target)?;
            }
            Ok(Some(detection))
        }
        Pattern::Chessboard => chessboard::find(image, target, options),
        Pattern::Charuco { dictionary, .. } => fiducial::find_charuco(image, target, dictionary, options),
        Pattern::Aprilgrid { .. } => fiducial::find_aprilgrid(image, target, options),
    }
}

/// Name of a kind of board as in `dataset.toml`.
pub(crate) fn kind(target: &Target) -> &'static str {
    match target.pattern {
        Pattern::AsymmetricCircles { .. } => "asymmetric-circles",
        Pattern::SymmetricCircles { .. } => "symmetric-circles",
        Pattern::Chessboard => "chessboard",
        Pattern::Charuco { .. } => "charuco",
        Pattern::Aprilgrid { .. } => "aprilgrid",
    }
}

fn check_target(target: &Target) -> Result<(), DetectError> {
    let positive = |field, value: f64| {
        let remedy = "must be a positive length in mm";
        if value > 0.0 && value.is_finite() { Ok(()) } else { Err(DetectError::Field { field, value, remedy }) }
    };
    positive("board.spacing_mm", target.spacing_mm)?;
    let too_small = |need| {
        let (kind, columns, rows) = (kind(target), target.columns, target.rows);
        Err(DetectError::BoardTooSmall { kind, columns, rows, need })
    };
    match target.pattern {
        Pattern::AsymmetricCircles { circle_diameter_mm } | Pattern::SymmetricCircles { circle_diameter_mm } => {
            positive("board.circle_diameter_mm", circle_diameter_mm)?;
            if circle_diameter_mm >= circles::step_mm(target) {
                let remedy = "dots must not touch: smaller than the distance between neighbours, in mm";
                return Err(DetectError::Field {
                    field: "board.circle_diameter_mm",
                    value: circle_diameter_mm,
                    remedy,
                });
            }
            if target.columns < 2 || target.rows < 3 || target.len() < 9 {
                return too_small("2 columns, 3 rows and 9 dots");
            }
        }
        Pattern::Chessboard if target.columns < 3 || target.rows < 3 => {
            return too_small("3 x 3 inner corners");
        }
        Pattern::Charuco { marker_mm, .. } => {
            positive("board.marker_mm", marker_mm)?;
            if marker_mm >= target.spacing_mm {
                let remedy = "markers must be smaller than the squares that they are in, spacing_mm";
                return Err(DetectError::Field { field: "board.marker_mm", value: marker_mm, remedy });
            }
            if target.columns < 3 || target.rows < 3 {
                return too_small("3 x 3 squares");
            }
        }
        Pattern::Aprilgrid { marker_mm } => {
            positive("board.marker_mm", marker_mm)?;
            if marker_mm >= target.spacing_mm {
                let remedy = "tags must be smaller than their pitch, spacing_mm";
                return Err(DetectError::Field { field: "board.marker_mm", value: marker_mm, remedy });
            }
            if target.is_empty() {
                return too_small("one tag");
            }
        }
        _ => {}
    }
    Ok(())
}
