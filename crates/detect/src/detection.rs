//! A board found in an image, and the options of the search.

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
}

/// How to look for a board.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DetectOptions {
    /// Whether markers are refined by fitting a model of their appearance to the grey values: discs for circle grids,
    /// crossings for chessboards and ChArUco boards, corners for tags. Without it, dots are centroids and corners are
    /// OpenCV's.
    pub refine: bool,
    /// Least number of markers for a ChArUco board or AprilGrid to count as found; at least 4 in any case.
    pub min_markers: usize,
}

impl Default for DetectOptions {
    fn default() -> Self {
        DetectOptions { refine: true, min_markers: 8 }
    }
}
