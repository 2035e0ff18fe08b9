//! ROS 1 bags, by the `rosbag` crate; those of RealSense and Orbbec cameras too.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use rosbag::{ChunkRecord, MessageRecord, RosBag};

use super::packet::{Layout, Packet, StreamInfo, Visitor, damaged};
use crate::error::ImportError;

pub(super) fn visit(
    path: &Path,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<(), ImportError> {
    check_index(path)?;
    let bag = RosBag::new(path).map_err(|error| ImportError::Read { path: path.to_owned(), error })?;
    let fault = |error: rosbag::Error| damaged(path, "ROS 1 bag", error);
    let mut streams: BTreeMap<u32, (StreamInfo, bool)> = BTreeMap::new();
    for record in bag.chunk_records() {
        let ChunkRecord::Chunk(chunk) = record.map_err(fault)? else { continue };
        for message in chunk.messages() {
            match message.map_err(fault)? {
                MessageRecord::Connection(connection) => {
                    let stream = StreamInfo { name: connection.topic.to_owned(), kind: connection.tp.to_owned() };
                    let is_wanted = wanted(&stream);
                    streams.insert(connection.id, (stream, is_wanted));
                }
                MessageRecord::MessageData(message) => {
                    let Some((stream, true)) = streams.get(&message.conn_id) else { continue };
                    let data = Cow::Borrowed(message.data);
                    let packet = Packet { stream, layout: Layout::Ros1, time_ns: message.time, data };
                    if visitor(packet)?.is_break() {
                        return Ok(());
                    }
                }
            }
        }
    }
    Ok(())
}

/// Refuses a bag whose index would begin beyond the end of the file, which the reader takes on trust.
fn check_index(path: &Path) -> Result<(), ImportError> {
    let unreadable = |error| ImportError::Read { path: path.to_owned(), error };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    // The first record is padded to 4096 bytes.
    let mut head = Vec::new();
    file.take(4096 + 13).read_to_end(&mut head).map_err(unreadable)?;
    let field = b"index_pos=";
    let place = head.windows(field.len()).position(|window| window == field).map(|at| at + field.len());
    let position = place.and_then(|at| head.get(at..)?.first_chunk()).map(|bytes| u64::from_le_bytes(*bytes));
    match position {
        // Records of chunks lie between the first record and the index.
        Some(index) if index >= head.len() as u64 && index <= length => Ok(()),
        Some(0) => Err(damaged(
            path,
            "ROS 1 bag",
            "it has no index, as its recording was interrupted (`rosbag reindex` adds one)",
        )),
        _ => Err(damaged(path, "ROS 1 bag", "it is cut off before its index")),
    }
}
