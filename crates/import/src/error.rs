//! Why a recording cannot be imported.

use std::path::PathBuf;

use depthcal_io::{FileError, ImageError};

/// Why a recording cannot be imported. Every message names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file cannot be opened or read.
    #[error("{path}: cannot read the recording: {error}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// A file that is no recording of a known kind.
    #[error(
        "{path}: this is no recording that can be imported: give an MCAP, a ROS 2 bag (.db3), a ROS 1 bag, or an Azure Kinect or Femto .mkv"
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// The container is broken.
    #[error("{path}: this {kind} is damaged: {message}; copy or record it anew")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        kind: &'static str,
        /// The reader's message.
        message: String,
    },
    /// A message that is not what its type says, or an encoding that is not supported.
    #[error("{path}: stream {stream}: {problem}")]
    Message {
        /// The file.
        path: PathBuf,
        /// Name of the stream.
        stream: String,
        /// The fault and the remedy.
        problem: String,
    },
    /// No stream of images.
    #[error("{path}: there are no images in it; its streams are {streams}")]
    NoImages {
        /// The file.
        path: PathBuf,
        /// Names and types of the streams.
        streams: String,
    },
    /// A stream that was asked for does not exist.
    #[error("{path}: there is no stream of images {wanted:?}; there are {streams}")]
    NoStream {
        /// The file.
        path: PathBuf,
        /// Name of the stream that was asked for.
        wanted: String,
        /// Names of the streams of images.
        streams: String,
    },
    /// Nothing to write.
    #[error(
        "{path}: none of the {looked_at} examined images of {stream} shows the board: check the board's kind, columns and rows, or leave the board out to \
             pick by sharpness alone"
    )]
    NoBoard {
        /// The file.
        path: PathBuf,
        /// Name of the stream.
        stream: String,
        /// Number of images that were searched.
        looked_at: usize,
    },
    /// An image at fault.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A file that cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The detector failed.
    #[error("{path}: searching the board: {message}")]
    Detect {
        /// The file.
        path: PathBuf,
        /// The detector's message.
        message: String,
    },
}
