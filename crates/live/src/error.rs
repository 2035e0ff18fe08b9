//! Why a live session cannot begin or go on.

use std::io;
use std::path::PathBuf;

use depthcal_detect::DetectError;
use depthcal_io::{DatasetError, FileError, ImageError};

/// Why a live session cannot begin or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// The source is no folder.
    #[error(
        "{path}: this is no folder: give the folder that the camera's program fills, or - for raw frames on standard input"
    )]
    NoFolder {
        /// The path.
        path: PathBuf,
    },
    /// A folder with depth whose unit is not declared.
    #[error(
        "{path}: there is depth, but no unit: give --unit-mm, the millimetres per step of the depth images (1 for depth in mm)"
    )]
    NoUnit {
        /// The folder.
        path: PathBuf,
    },
    /// The folder for the kept frames is the source.
    #[error("{path}: the kept frames cannot go into the folder that the camera fills: give --out another one")]
    OutIsSource {
        /// The folder.
        path: PathBuf,
    },
    /// The folder for the kept frames holds something else.
    #[error("{path}: {problem}: give --out another folder, or continue with the board and camera of this one")]
    OtherDataset {
        /// The folder or file.
        path: PathBuf,
        /// How it differs.
        problem: String,
    },
    /// Raw frames that break the framing.
    #[error("frame {number} on standard input: {problem}")]
    Stream {
        /// Number of the frame, from 1.
        number: u64,
        /// How it breaks the framing.
        problem: String,
    },
    /// The board cannot be searched.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// A dataset cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A folder cannot be listed or changed.
    #[error("{path}: {error}")]
    Folder {
        /// The folder or file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// No connections are accepted at this address.
    #[error("port {port}: {error}: give --port another one, or --port 0 for any that is free")]
    Listen {
        /// The port.
        port: u16,
        /// The operating system's error.
        error: io::Error,
    },
}
