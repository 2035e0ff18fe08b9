//! Containers: what a recording holds, message by message in the order of the file.

mod attachment;
mod bag;
mod bounded;
mod compressed;
mod db3;
mod file;
mod folder;
mod mcap_file;
mod mkv;
mod packet;

pub(crate) use file::Recording;
pub(crate) use folder::{DEPTH_FILES, IMAGE_FILES};
pub use packet::StreamInfo;
pub(crate) use packet::{Layout, Packet};
