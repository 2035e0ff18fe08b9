//! Streams, their messages, and faults that all containers share.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;

use crate::error::ImportError;
use crate::picture::Encoding;

/// A stream of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamInfo {
    /// Its topic, or name of its track.
    pub name: String,
    /// Type of its messages, such as `sensor_msgs/Image`, or the track's codec.
    pub kind: String,
}

/// How the bytes of messages are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layout {
    /// ROS 2: CDR with its four bytes of encapsulation.
    Cdr,
    /// ROS 1: packed, little-endian.
    Ros1,
    /// A frame of a Matroska track of this width and height.
    Track([usize; 2]),
    /// A whole image file.
    File,
    /// Pixels of an image of this width and height, without gaps.
    Pixels([usize; 2], Encoding),
    /// Any that is not read, such as JSON.
    Unread,
}

/// A message of a stream.
pub(crate) struct Packet<'a> {
    pub stream: &'a StreamInfo,
    pub layout: Layout,
    /// Time of recording, ns.
    pub time_ns: u64,
    pub data: Cow<'a, [u8]>,
}

/// The function that is called with each message; `Break` ends the reading.
pub(crate) type Visitor<'a> = dyn FnMut(Packet<'_>) -> Result<ControlFlow<()>, ImportError> + 'a;

/// How the reading of a file ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// With its last message.
    Whole,
    /// The visitor wants no more.
    Stopped,
    /// Within a record: the file is cut off.
    Cut,
}

/// The place of a file's contents, and the name of it in errors. A file that was compressed as a whole is read elsewhere.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub file: &'a Path,
    pub name: &'a Path,
}

impl Source<'_> {
    pub fn unreadable(&self, error: std::io::Error) -> ImportError {
        ImportError::Read { path: self.name.to_owned(), error }
    }

    pub fn damaged(&self, kind: &'static str, message: impl std::fmt::Display) -> ImportError {
        damaged(self.name, kind, message)
    }
}

/// `sensor_msgs/msg/Image` of ROS 2 as ROS 1 has it: `sensor_msgs/Image`.
pub(super) fn plain_type(name: &str) -> String {
    name.replace("/msg/", "/")
}

pub(super) fn damaged(path: &Path, kind: &'static str, message: impl std::fmt::Display) -> ImportError {
    ImportError::Damaged { path: path.to_owned(), kind, message: message.to_string() }
}
