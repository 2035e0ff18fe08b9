//! Finds calibration boards in images and refines their markers.
//!
//! [`detect()`] finds the markers of a [`Target`](depthcal_model::target::Target) in one image, [`detect_all`] in many
//! images in parallel. Once a camera is known approximately, [`refine_circles`] fits the centres of dots again under
//! that camera, which removes the bias of circle centres under perspective; while there is none, [`homography_mapping`]
//! takes its place. [`measure_circle_diameter`] measures dots whose size is not known. [`refine_corners`] fits the corners of chessboards and tags.
//!
//! Chessboards, ChArUco boards and AprilGrids are found with OpenCV. Circle grids are found by code of this crate,
//! which copes with small dots, uneven light and clutter better than OpenCV's grid finder does.
//!
//! Pixel centres have integer coordinates, as in OpenCV. Board frame and order of the markers are those of
//! `depthcal-model`.
//!
//! # Features
//! `opencv` (default) links OpenCV. Without it circle grids are found as well, and refinement and geometry stay; the
//! other boards give [`DetectError::MissingFeature`].

mod batch;
mod board;
mod check;
#[cfg(feature = "opencv")]
mod chessboard;
mod circles;
mod detect;
mod detection;
mod error;
#[cfg(feature = "opencv")]
mod fiducial;
mod geometry;
mod lattice;
#[cfg(feature = "opencv")]
mod open_cv;
mod refine;
mod stretch;

pub use batch::{FrameError, detect_all};
pub use detect::detect;
pub use detection::{DetectOptions, Detection, Marker, Polarity};
pub use error::DetectError;
#[cfg(feature = "opencv")]
pub use fiducial::tag_cells;
pub use geometry::{BoardMap, Homography};
pub use refine::{
    CircleDiameter, RefineOptions, RefinedMarker, homography_mapping, measure_circle_diameter, refine_circles,
    refine_corners,
};
