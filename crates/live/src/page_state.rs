//! The state of a session as its page shows it.

use serde::Serialize;

use crate::fit::FitSummary;

/// The state of a session as its page shows it. Pixels are those of the camera's image.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct PageState {
    /// Number of the picture; it changes with every frame.
    pub picture: u64,
    /// Width and height of the image; zeros before the first frame.
    pub size: [usize; 2],
    /// The board in the picture.
    pub board: Option<BoardSeen>,
    /// The pose that is wanted next.
    pub wanted: Option<Wanted>,
    /// Number of kept frames.
    pub count: usize,
    /// The views of those whose pose is known.
    pub kept: Vec<KeptDot>,
    /// Columns and rows of the grid over the image.
    pub grid: [usize; 2],
    /// Markers of kept frames in every cell, row by row.
    pub cells: Vec<u32>,
    /// The last fit.
    pub fit: Option<FitSummary>,
    /// Why the frames are not fitted yet.
    pub unfitted: Option<String>,
    /// Whether a fit runs.
    pub is_fitting: bool,
    /// Number of frames that were kept or taken back, for the sound.
    pub events: u64,
    /// The last thing that happened, in words.
    pub message: String,
    /// How the source ended; absent while it runs.
    pub source_ended: Option<String>,
    /// Whether the session is over.
    pub is_over: bool,
}

/// A board in the picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BoardSeen {
    /// Its markers, px.
    pub markers: Vec<[f64; 2]>,
    /// Whether the image is sharp.
    pub is_sharp: bool,
    /// Whether the board is at rest.
    pub is_still: bool,
}

/// A wanted pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Wanted {
    /// The outline of its markers, px.
    pub outline: Vec<[f64; 2]>,
    /// Distance, place and tilt.
    pub words: String,
    /// Whether the board is there.
    pub is_reached: bool,
    /// The movement that brings the board there.
    pub hint: Option<String>,
}

/// A kept frame among the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KeptDot {
    /// Its name.
    pub name: String,
    /// Depth of the board's middle, mm.
    pub distance_mm: f64,
    /// Angle between the board and the image, degrees.
    pub tilt_deg: f64,
    /// Turn about the horizontal and the vertical axis, degrees.
    pub turn_deg: [f64; 2],
}
