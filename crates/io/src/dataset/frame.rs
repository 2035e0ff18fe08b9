//! A frame, and the frames of a camera while they are found.

use std::path::PathBuf;

use super::candidate::Candidate;
use super::frame_table::FrameMetadata;
use super::pairing::{Pairing, Stray};

/// One capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The part that the stems of its files have in common, or its name in the table that names its files. Frames of several
    /// cameras that were taken together have one name.
    pub name: String,
    /// The image; `None` where the dataset declares none.
    pub image: Option<PathBuf>,
    /// The depth image; `None` where the dataset declares none.
    pub depth: Option<PathBuf>,
    /// Its row in the table of frames.
    pub metadata: FrameMetadata,
}

/// The frames of a camera in natural order of their names, and what belongs to none.
#[derive(Debug, Default)]
pub(crate) struct Frames {
    pub frames: Vec<Frame>,
    pub pairing: Pairing,
    pub strays: Vec<Stray>,
    /// Tables and lists that were read.
    pub lists: Vec<PathBuf>,
}

/// A frame of these files.
pub(super) fn frame(
    name: String,
    image: Option<&Candidate>,
    depth: Option<&Candidate>,
    timestamp_s: Option<f64>,
) -> Frame {
    let path = |file: Option<&Candidate>| file.map(|file| file.path.clone());
    let metadata = FrameMetadata { timestamp_s, ..FrameMetadata::default() };
    Frame { name, image: path(image), depth: path(depth), metadata }
}
