//! A board found in an image, and the options of the search.

use depthcal_model::target::CharucoLayout;
use serde::{Deserialize, Serialize};

/// A marker of the board in the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Index in the order of [`Target::point`](depthcal_model::target::Target::point).
    pub index: usize,
    /// Position [u, v], px; pixel centres have integer coordinates, as in OpenCV.
    pub pixel: [f64; 2],
}

/// Whether the print is darker or brighter than the board around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Polarity {
    /// Dark print on bright paper. All boards but circle grids are reported so.
    DarkOnBright,
    /// Bright dots on a dark board.
    BrightOnDark,
}

/// A board found in an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// The markers, in ascending order of their index. Of circle grids and chessboards at most a few are missing, those
    /// that are hidden or unclear (a reflection); ChArUco boards and AprilGrids may be visible in part.
    pub markers: Vec<Marker>,
    /// Dark or bright dots.
    pub polarity: Polarity,
    /// The layout of a ChArUco board with an even number of rows; `None` for all other boards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub charuco_layout: Option<CharucoLayout>,
}

/// Which code looks for chessboards and tags: by default OpenCV where it is there. Circle grids, and the refinement of all
/// markers, are this crate's own in any case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detector {
    /// This crate's own.
    #[cfg_attr(not(feature = "opencv"), default)]
    BuiltIn,
    /// OpenCV's, of the feature `opencv`.
    #[cfg_attr(feature = "opencv", default)]
    OpenCv,
}

/// How to look for a board.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DetectOptions {
    /// Whether markers are refined by fitting a model of their appearance to the grey values: discs for circle grids,
    /// crossings for chessboards and ChArUco boards, corners for tags. Without it, dots are centroids and corners are
    /// the detector's.
    pub refine: bool,
    /// Least number of markers for a ChArUco board or AprilGrid to count as found; at least 4 in any case.
    pub min_markers: usize,
    /// Which code looks for chessboards and tags.
    pub detector: Detector,
    /// The layout of a ChArUco board with an even number of rows, where it is known; else it is told from the tags.
    pub charuco_layout: Option<CharucoLayout>,
    /// Number of the board's first tag in the dictionary: 0 but for one of several boards.
    #[serde(default)]
    pub first_tag: usize,
}

impl Default for DetectOptions {
    fn default() -> Self {
        DetectOptions {
            refine: true,
            min_markers: 8,
            detector: Detector::default(),
            charuco_layout: None,
            first_tag: 0,
        }
    }
}
