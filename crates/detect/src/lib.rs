//! Finds calibration boards in images and refines their markers.
//!
//! [`detect`] answers where the markers of a [`Target`](depthcal_model::target::Target) are in one image,
//! [`detect_all`] does so for many images in parallel. [`refine_circles`] finds the centres of dots again with what is
//! known of the camera by then, so that the bias of circle centres under perspective is gone; [`homography_mapping`]
//! stands in for the camera while there is none.
//!
//! Chessboards and fiducials are found with OpenCV, circle grids by own code; see there for why. Pixel centres have
//! integer coordinates, as in OpenCV. The board frame and the order of the markers are those of `depthcal-model`.

mod batch;
mod chessboard;
mod circles;
mod detection;
mod error;
mod fiducial;
mod geometry;
mod refine;
mod saddles;
mod stretch;

pub use batch::{FrameError, detect_all};
pub use detection::{DetectOptions, Detection, Marker, Polarity, detect};
pub use error::DetectError;
pub use geometry::{BoardMap, Homography};
pub use refine::{RefineOptions, RefinedMarker, homography_mapping, refine_circles, refine_corners};
