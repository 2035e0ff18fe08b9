//! ROS 1 bags, by the `rosbag` crate; those of RealSense and Orbbec cameras too.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use rosbag::{ChunkRecord, MessageRecord, RosBag};

use super::packet::{Layout, Packet, StreamInfo, Visitor, damaged};
use crate::error::ImportError;

const VERSION: &[u8] = b"#ROSBAG V2.0\n";

pub(super) fn visit(
    path: &Path,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<(), ImportError> {
    check_claims(path)?;
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

/// Refuses a bag whose index would begin beyond the end of the file, or with a chunk that claims more memory than it can fill:
/// the reader takes both on trust.
fn check_claims(path: &Path) -> Result<(), ImportError> {
    let unreadable = |error| ImportError::Read { path: path.to_owned(), error };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    match check_records(&mut BufReader::new(file), length) {
        Ok(None) => Ok(()),
        Ok(Some(fault)) => Err(damaged(path, "ROS 1 bag", fault)),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(damaged(path, "ROS 1 bag", "it is cut off")),
        Err(error) => Err(unreadable(error)),
    }
}

/// Bytes of a chunk per byte of it compressed, at most, and largest chunk, bytes. Recorders begin a new chunk after 768 KiB; LZ4
/// and bzip2 make 1/255 and less of images of one grey value.
const LARGEST_RATIO: u64 = 1024;
const LARGEST: u64 = 1 << 30;
/// Longest header of a record, bytes: that of a connection has the name of its topic.
const LONGEST_HEADER: u32 = 1 << 20;

/// Walks over the records before the index, of which it reads the headers; says what is wrong with the first that claims too
/// much.
fn check_records(reader: &mut BufReader<File>, length: u64) -> io::Result<Option<String>> {
    reader.seek_relative(VERSION.len() as i64)?;
    let mut position = VERSION.len() as u64;
    // The first record says where the index begins.
    let mut index = None;
    while index.is_none_or(|index| position < index) {
        let record = position;
        let header_length = u32::from_le_bytes(read4(reader)?);
        if header_length > LONGEST_HEADER {
            return Ok(Some(format!("its record at byte {record} has an implausibly long header")));
        }
        let mut header = vec![0; header_length as usize];
        reader.read_exact(&mut header)?;
        let data = u64::from(u32::from_le_bytes(read4(reader)?));
        let end = match index {
            Some(end) => end,
            None => match field(&header, b"index_pos=").and_then(|bytes| bytes.first_chunk()) {
                Some([0, 0, 0, 0, 0, 0, 0, 0]) => {
                    let interrupted = "it has no index, as its recording was interrupted (`rosbag reindex` adds one)";
                    return Ok(Some(interrupted.to_owned()));
                }
                Some(bytes) => u64::from_le_bytes(*bytes),
                None => return Ok(Some("its first record does not say where the index is".to_owned())),
            },
        };
        if end > length {
            return Ok(Some("it is cut off before its index".to_owned()));
        }
        index = Some(end);
        if let Some(size) = field(&header, b"size=").and_then(|bytes| bytes.first_chunk()) {
            let size = u64::from(u32::from_le_bytes(*size));
            if size > LARGEST || size / LARGEST_RATIO > data {
                return Ok(Some(format!("its chunk at byte {record} claims {size} bytes, made of {data}")));
            }
        }
        position += 8 + u64::from(header_length) + data;
        if position > end {
            return Ok(Some(format!("its record at byte {record} reaches into the index")));
        }
        reader.seek_relative(data as i64)?;
    }
    Ok(None)
}

fn read4(reader: &mut impl Read) -> io::Result<[u8; 4]> {
    let mut bytes = [0; 4];
    reader.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// The value of the field that begins with `name`.
fn field<'a>(header: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let mut unread = header;
    while let Some((length, tail)) = unread.split_first_chunk() {
        let (one, tail) = tail.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        if let Some(value) = one.strip_prefix(name) {
            return Some(value);
        }
        unread = tail;
    }
    None
}
