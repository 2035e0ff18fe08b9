//! ROS 1 bags (format 2.0, wiki.ros.org/Bags/Format/2.0); those of RealSense and Orbbec cameras too.
//!
//! Records before the index are read one after the other; the index is not, so that a bag whose recording was interrupted, or
//! whose copy is not complete, is read up to its last complete record.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};

use super::packet::{End, Layout, Packet, Source, StreamInfo, Visitor};
use crate::error::ImportError;

const VERSION: &[u8] = b"#ROSBAG V2.0\n";
const KIND: &str = "ROS 1 bag";

/// Bytes of a chunk per byte of it compressed, at most, and largest chunk, bytes. Recorders begin a new chunk after 768 KiB; LZ4
/// and bzip2 make 1/255 and less of images of one grey value.
const LARGEST_RATIO: u64 = 1024;
const LARGEST: u64 = 1 << 30;
/// Longest header of a record, bytes: that of a connection has the name of its topic.
const LONGEST_HEADER: u32 = 1 << 20;

/// Types of records.
const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

pub(super) fn visit(
    source: Source<'_>,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<End, ImportError> {
    let file = File::open(source.file).map_err(|error| source.unreadable(error))?;
    let length = file.metadata().map_err(|error| source.unreadable(error))?.len();
    let mut bag = Bag { source, reader: BufReader::new(file), position: 0, length };
    bag.skip(VERSION.len() as u64)?;
    let mut streams: Streams = BTreeMap::new();
    let Some(index) = bag.index()? else {
        return Err(source.damaged(KIND, "it is cut off in its first record"));
    };
    let mut has_chunks = false;
    loop {
        if index.is_some_and(|index| bag.position >= index) {
            return Ok(End::Whole);
        }
        // Without an index the file ends with its last record.
        if index.is_none() && bag.position == length {
            return Ok(if has_chunks { End::Cut } else { End::Whole });
        }
        let record = bag.position;
        let Some((header, size)) = bag.header()? else { break };
        if index.is_some_and(|index| bag.position + size > index) {
            return Err(source.damaged(KIND, format!("its record at byte {record} reaches into the index")));
        }
        if op(&header) != Some(CHUNK) {
            if bag.position + size > length {
                break;
            }
            bag.skip(size)?;
            continue;
        }
        let Some(records) = bag.chunk(record, &header, size)? else { break };
        has_chunks = true;
        if !messages(source, &records, &mut streams, wanted, visitor)? {
            return Ok(End::Stopped);
        }
    }
    if has_chunks { Ok(End::Cut) } else { Err(source.damaged(KIND, "it is cut off before its first message")) }
}

/// Streams by the numbers of their connections, and whether they are wanted.
type Streams = BTreeMap<u32, (StreamInfo, bool)>;

/// Calls the visitor with the messages of a chunk; false where it wants no more.
fn messages(
    source: Source<'_>,
    records: &[u8],
    streams: &mut Streams,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<bool, ImportError> {
    let broken = || source.damaged(KIND, "a record is longer than its chunk, or lacks a field");
    let mut unread = records;
    while !unread.is_empty() {
        let (header, after) = counted(unread).ok_or_else(broken)?;
        let (data, after) = counted(after).ok_or_else(broken)?;
        unread = after;
        let connection = || u32_of(header, b"conn=").ok_or_else(broken);
        match op(header) {
            Some(CONNECTION) => {
                let text = |bytes: Option<&[u8]>| bytes.map(|b| String::from_utf8_lossy(b).into_owned());
                let name = text(field(header, b"topic=")).ok_or_else(broken)?;
                let stream = StreamInfo { name, kind: text(field(data, b"type=")).ok_or_else(broken)? };
                let is_wanted = wanted(&stream);
                streams.insert(connection()?, (stream, is_wanted));
            }
            Some(MESSAGE) => {
                let Some((stream, true)) = streams.get(&connection()?) else { continue };
                let time = field(header, b"time=").and_then(|time| time.first_chunk()).ok_or_else(broken)?;
                // Seconds in the lower half, nanoseconds in the upper one.
                let time = u64::from_le_bytes(*time);
                let time_ns = (time & 0xffff_ffff) * 1_000_000_000 + (time >> 32);
                let packet = Packet { stream, layout: Layout::Ros1, time_ns, data: Cow::Borrowed(data) };
                if visitor(packet)?.is_break() {
                    return Ok(false);
                }
            }
            _ => {}
        }
    }
    Ok(true)
}

/// A file that is read record by record.
struct Bag<'a> {
    source: Source<'a>,
    reader: BufReader<File>,
    /// Bytes that were read or passed over.
    position: u64,
    length: u64,
}

impl Bag<'_> {
    /// The place of the index by the first record; the inner `None` where recording was interrupted, the outer one where the file
    /// ends in that record.
    fn index(&mut self) -> Result<Option<Option<u64>>, ImportError> {
        let Some((header, size)) = self.header()? else { return Ok(None) };
        let Some(index) = field(&header, b"index_pos=").and_then(|bytes| bytes.first_chunk()) else {
            return Err(self.source.damaged(KIND, "its first record does not say where the index is"));
        };
        if self.position + size > self.length {
            return Ok(None);
        }
        self.skip(size)?;
        let index = Some(u64::from_le_bytes(*index)).filter(|index| *index != 0);
        if index.is_some_and(|index| index < self.position) {
            return Err(self.source.damaged(KIND, "its first record reaches into the index"));
        }
        Ok(Some(index))
    }

    /// The header of the next record and the size of its data; `None` at the end of the file.
    fn header(&mut self) -> Result<Option<(Vec<u8>, u64)>, ImportError> {
        let record = self.position;
        let Some(size) = self.u32()? else { return Ok(None) };
        if size > LONGEST_HEADER {
            return Err(self
                .source
                .damaged(KIND, format!("its record at byte {record} has an implausibly long header")));
        }
        let mut header = vec![0; size as usize];
        if !self.fill(&mut header)? {
            return Ok(None);
        }
        Ok(self.u32()?.map(|size| (header, u64::from(size))))
    }

    /// The records of the chunk whose header was read, out of its compression; `None` where the file ends within it.
    fn chunk(&mut self, record: u64, header: &[u8], size: u64) -> Result<Option<Vec<u8>>, ImportError> {
        let damaged = |problem: String| self.source.damaged(KIND, format!("its chunk at byte {record} {problem}"));
        let claim = u64::from(u32_of(header, b"size=").ok_or_else(|| damaged("has no size".into()))?);
        if claim > LARGEST || claim / LARGEST_RATIO > size {
            return Err(damaged(format!("claims {claim} bytes, made of {size}")));
        }
        if self.position + size > self.length {
            return Ok(None);
        }
        let mut records = Vec::with_capacity(claim as usize);
        let mut data = (&mut self.reader).take(size);
        let read = match field(header, b"compression=") {
            Some(b"none") => data.read_to_end(&mut records),
            Some(b"lz4") => lz4::Decoder::new(&mut data).and_then(|lz4| lz4.take(claim).read_to_end(&mut records)),
            Some(b"bz2") => bzip2::read::BzDecoder::new(&mut data).take(claim).read_to_end(&mut records),
            other => {
                let name = String::from_utf8_lossy(other.unwrap_or_default()).into_owned();
                return Err(damaged(format!("is compressed by {name:?}, which is not read: `rosbag decompress` it")));
            }
        };
        read.map_err(|error| damaged(format!("cannot be decompressed: {error}")))?;
        // What the decoder leaves of its input.
        let left = data.limit();
        self.reader.seek_relative(left as i64).map_err(|error| self.source.unreadable(error))?;
        self.position += size;
        if records.len() as u64 != claim {
            return Err(damaged(format!("has {} bytes instead of {claim}", records.len())));
        }
        Ok(Some(records))
    }

    fn u32(&mut self) -> Result<Option<u32>, ImportError> {
        let mut bytes = [0; 4];
        Ok(self.fill(&mut bytes)?.then(|| u32::from_le_bytes(bytes)))
    }

    /// Fills the buffer; false where the file ends before.
    fn fill(&mut self, buffer: &mut [u8]) -> Result<bool, ImportError> {
        self.position += buffer.len() as u64;
        match self.reader.read_exact(buffer) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
            Err(error) => Err(self.source.unreadable(error)),
        }
    }

    fn skip(&mut self, bytes: u64) -> Result<(), ImportError> {
        self.position += bytes;
        let skipped: io::Result<()> = self.reader.seek_relative(bytes as i64);
        skipped.map_err(|error| self.source.unreadable(error))
    }
}

/// The type of a record.
fn op(header: &[u8]) -> Option<u8> {
    field(header, b"op=").and_then(|bytes| bytes.first().copied())
}

fn u32_of(header: &[u8], name: &[u8]) -> Option<u32> {
    field(header, name).and_then(|bytes| bytes.first_chunk()).map(|bytes| u32::from_le_bytes(*bytes))
}

/// Bytes behind their count, and those behind them.
fn counted(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, tail) = bytes.split_first_chunk()?;
    tail.split_at_checked(u32::from_le_bytes(*length) as usize)
}

/// The value of the field that begins with `name`.
fn field<'a>(header: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let mut unread = header;
    while let Some((one, tail)) = counted(unread) {
        if let Some(value) = one.strip_prefix(name) {
            return Some(value);
        }
        unread = tail;
    }
    None
}
