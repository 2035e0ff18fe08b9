//! Finds calibration boards in images and refines their markers.
//!
//! [`detect()`] finds the markers of a [`Target`](depthcal_model::target::Target) in one image, [`detect_all`] in many
//! images in parallel. Once a camera is known approximately, [`refine_circles`] fits the centres of dots again under
//! that camera, which removes the bias of circle centres under perspective; while there is none, [`homography_mapping`]
//! takes its place. [`measure_circle_diameter`] measures dots whose size is not known. [`refine_corners`] fits the corners of
//! chessboards and tags.
//!
//! All boards are found by code of this crate. [`Detector::OpenCv`] looks for chessboards and tags with OpenCV instead.
//!
//! Pixel centres have integer coordinates, as in OpenCV. Board frame and order of the markers are those of
//! `depthcal-model`.
//!
//! # Features
//! `opencv` links OpenCV, for [`Detector::OpenCv`].

mod batch;
mod board;
mod check;
mod chessboard;
mod circles;
mod detect;
mod detection;
mod error;
mod fiducial;
mod geometry;
mod lattice;
#[cfg(feature = "opencv")]
mod open_cv;
mod refine;
mod stretch;
mod tags;

pub use batch::{FrameError, detect_all};
pub use chessboard::chessboard_size;
pub use detect::detect;
pub use detection::{DetectOptions, Detection, Detector, Marker, Polarity};
pub use error::DetectError;
pub use fiducial::{tag_cells, tag_square};
pub use geometry::{BoardMap, Homography};
pub use refine::{
    CircleDiameter, RefineOptions, RefinedMarker, homography_mapping, measure_circle_diameter, refine_circles,
    refine_corners,
};
pub use tags::{SeenTag, SeenTags, survey_tags};
