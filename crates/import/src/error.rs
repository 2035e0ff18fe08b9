//! Why a recording cannot be imported.

use std::path::PathBuf;

use depthcal_io::{FileError, ImageError};

/// The times of a stream's images.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// Name of the stream.
    pub stream: String,
    /// Number of images.
    pub count: usize,
    /// Time of the first, s, by its own clock.
    pub first_s: f64,
    /// Time of the last, s.
    pub last_s: f64,
}

impl std::fmt::Display for Span {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Span { stream, count, first_s, last_s } = self;
        write!(f, "{count} of {stream} from {first_s:.3} s to {last_s:.3} s")
    }
}

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
        "{path}: this is no recording that can be imported: give an MCAP, a ROS 2 bag (.db3, or its folder), a ROS 1 bag, an Azure Kinect or \
         Femto .mkv, or a folder of TUM RGB-D (rgb.txt, depth.txt), Stray Scanner (camera_matrix.csv, odometry.csv, depth) or Record3D (metadata, \
         rgbd)"
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// A ZIP archive, as `.r3d` files are.
    #[error("{path}: this is a ZIP archive: unzip it, and give the folder; of Record3D it has metadata and rgbd")]
    Archive {
        /// The file.
        path: PathBuf,
    },
    /// A folder of image files that cannot be read.
    #[error("{path}: {problem}")]
    Folder {
        /// The file or folder at fault.
        path: PathBuf,
        /// The fault and the remedy.
        problem: String,
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
    /// No image has depth near in time.
    #[error(
        "{path}: no image has depth near in time: {}, {}; if they were recorded together, by two clocks, pair them by a constant \
         offset (--pair {offset_s:.3}, seconds that are added to the depth's times) or by their order (--pair order)",
        .streams[0],
        .streams[1]
    )]
    Unpaired {
        /// The file.
        path: PathBuf,
        /// Times of the images and of the depth.
        streams: Box<[Span; 2]>,
        /// Seconds between the two clocks, as far as the recording tells.
        offset_s: f64,
    },
    /// Images and depth are to be paired by their order, but there are not as many of both.
    #[error(
        "{path}: {images} images and {depths} depth images are not paired by their order: leave --pair out, or give an offset in seconds"
    )]
    Counts {
        /// The file.
        path: PathBuf,
        /// Number of images.
        images: usize,
        /// Number of depth images.
        depths: usize,
    },
    /// All images are within the part that is left out.
    #[error(
        "{path}: none of the {images} images of {stream} is later than {skip_s} s after the first: make --skip-s smaller"
    )]
    Skipped {
        /// The file.
        path: PathBuf,
        /// Name of the stream.
        stream: String,
        /// Number of images.
        images: usize,
        /// Seconds that are left out.
        skip_s: f64,
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
