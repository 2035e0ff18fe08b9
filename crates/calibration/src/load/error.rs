//! Why a dataset gives no observations.

use std::path::PathBuf;

use depthcal_io::{CornerFileError, DatasetError, FileError, ImageError};
use thiserror::Error;

use super::declared_camera::DeclaredCameraError;
use super::given_markers_error::GivenMarkersError;
#[cfg(feature = "detect")]
use crate::cause::BoardCause;

/// Why a dataset gives no observations.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The dataset's description is at fault.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An image is at fault.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The files of one camera of several give no observations.
    #[error("camera {camera}: {source}")]
    Camera {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<LoadError>,
    },
    /// The intrinsics that are declared for a camera cannot be used.
    #[error(transparent)]
    Declared(#[from] DeclaredCameraError),
    /// The dataset has no images.
    #[error("{}: [frames] declares no images: set frames.image to a pattern such as \"image/*.png\", or image in a section [cameras.NAME]", root.display())]
    NoImages {
        /// The dataset's folder.
        root: PathBuf,
    },
    /// Images of a dataset differ in size.
    #[error(
        "{}: the image has {}×{} pixels, but others of the dataset have {}×{}: one camera has one size; leave this frame out, or record it like \
         the others",
        path.display(), .found.0, .found.1, .expected.0, .expected.1
    )]
    Size {
        /// The image.
        path: PathBuf,
        /// Its width and height.
        found: (usize, usize),
        /// Those of most images.
        expected: (usize, usize),
    },
    /// No frame shows the board.
    #[error("the board ({board}) was not found in any of the {frames} frames of {}: check columns, rows and kind under \
             [board] in dataset.toml, and that the whole board is visible{}", root.display(),
        .tried.map_or(String::new(), |tried| format!(" ({tried})")))]
    NoBoard {
        /// The dataset's folder.
        root: PathBuf,
        /// Size of the board that was searched for, in words.
        board: String,
        /// Frames looked at.
        frames: usize,
        /// The other boards that were looked for, in words.
        tried: Option<&'static str>,
    },
    /// The images show another board than the declared one.
    #[cfg(feature = "detect")]
    #[error("{}: {cause}", root.display())]
    OtherBoard {
        /// The dataset's folder.
        root: PathBuf,
        /// The board that they show.
        cause: Box<BoardCause>,
    },
    /// Markers of a frame that cannot be.
    #[error("frame '{frame}': {problem}")]
    Marker {
        /// The frame.
        frame: String,
        /// The fault, in words.
        problem: String,
    },
    /// This program was built without detection.
    #[error("{}: this program was built without detection (feature 'detect'), and no cached detection of this dataset \
             exists: run `depthcal detect` with a program that has it, or build with default features", root.display())]
    NoDetection {
        /// The dataset's folder.
        root: PathBuf,
    },
    /// The file of markers is at fault.
    #[error(transparent)]
    CornerFile(#[from] CornerFileError),
    /// The markers of a file cannot be used for the dataset.
    #[error(transparent)]
    GivenMarkers(#[from] GivenMarkersError),
    /// Detection failed.
    #[cfg(feature = "detect")]
    #[error(transparent)]
    Detect(#[from] depthcal_detect::DetectError),
}

impl LoadError {
    /// The error of a frame of a dataset whose others have this size: where its depth image has it too, the image is at fault.
    pub(super) fn of_usual_size(self, usual: (usize, usize)) -> Self {
        match self {
            Self::Image(ImageError::SizesDiffer { image, image_size: [width, height], depth_size, .. })
                if <(usize, usize)>::from(depth_size) == usual =>
            {
                Self::Size { path: image, found: (width, height), expected: usual }
            }
            other => other,
        }
    }
}
