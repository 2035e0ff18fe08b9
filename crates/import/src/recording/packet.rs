//! Streams, their messages, and faults that all containers share.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;

use crate::error::ImportError;

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
}

/// A message of a stream.
pub(crate) struct Packet<'a> {
    /// Position of its stream in the list of [`Recording::visit`].
    pub stream: &'a StreamInfo,
    pub layout: Layout,
    /// Time of recording, ns.
    pub time_ns: u64,
    pub data: Cow<'a, [u8]>,
}

/// The function that is called with each message; `Break` ends the reading.
pub(crate) type Visitor<'a> = dyn FnMut(Packet<'_>) -> Result<ControlFlow<()>, ImportError> + 'a;

/// `sensor_msgs/msg/Image` of ROS 2 as ROS 1 has it: `sensor_msgs/Image`.
pub(super) fn plain_type(name: &str) -> String {
    name.replace("/msg/", "/")
}

pub(super) fn damaged(path: &Path, kind: &'static str, message: impl std::fmt::Display) -> ImportError {
    ImportError::Damaged { path: path.to_owned(), kind, message: message.to_string() }
}
