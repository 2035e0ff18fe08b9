//! MCAP, by the `mcap` crate: ROS 2's default, also with messages of ROS 1.
//!
//! The crate takes records apart, out of chunks and compression. Their fields are read here, since the crate reserves memory for
//! strings by the lengths that they claim.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};

use mcap::McapError;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::packet::{End, Layout, Packet, Source, StreamInfo, Visitor, plain_type};
use crate::error::ImportError;

/// Bytes of a record per byte of the file, and most bytes of one where the file is shorter: those of compressed chunks are
/// allocated before they are read. Images of one grey value shrink to a thousandth.
const LARGEST_RATIO: u64 = 1024;
const LARGEST: u64 = 1 << 30;
/// Bytes that are read at a time, so that memory grows with the file, not with what a record claims.
const STEP: usize = 1 << 20;

const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;

struct Channel {
    stream: StreamInfo,
    layout: Layout,
    is_wanted: bool,
}

impl Channel {
    fn new(name: String, schema: &str, encoding: &str, wanted: &dyn Fn(&StreamInfo) -> bool) -> Self {
        let kind = plain_type(schema);
        let (kind, layout) = match encoding {
            "cdr" => (kind, Layout::Cdr),
            "ros1" => (kind, Layout::Ros1),
            other => (format!("{kind} as {other}, which is not read"), Layout::Unread),
        };
        let stream = StreamInfo { name, kind };
        let is_wanted = wanted(&stream);
        Channel { stream, layout, is_wanted }
    }
}

pub(super) fn visit(
    source: Source<'_>,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<End, ImportError> {
    let damaged = |problem: String| source.damaged("MCAP", problem);
    let file = File::open(source.file).map_err(|error| source.unreadable(error))?;
    let length = file.metadata().map_err(|error| source.unreadable(error))?.len();
    let limit = length.saturating_mul(LARGEST_RATIO).min(LARGEST).max(length);
    let options = LinearReaderOptions::default().with_record_length_limit(limit.try_into().unwrap_or(usize::MAX));
    let mut file = BufReader::new(file);
    let mut reader = LinearReader::new_with_options(options);
    let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
    let mut channels: BTreeMap<u16, Channel> = BTreeMap::new();
    let mut has_messages = false;
    while let Some(event) = reader.next_event() {
        let (op, data) = match event {
            Ok(LinearReadEvent::ReadRequest(bytes)) => {
                let read = file.read(reader.insert(bytes.clamp(1, STEP))).map_err(|error| source.unreadable(error))?;
                reader.notify_read(read);
                continue;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => (opcode, Record { rest: data }),
            // A recording that was interrupted, or a copy that is not complete.
            Err(McapError::UnexpectedEof) if has_messages => return Ok(End::Cut),
            Err(error) => return Err(damaged(error.to_string())),
        };
        let cut = || damaged(format!("a record of type {op} is cut off"));
        match op {
            SCHEMA => {
                let (id, name) = data.schema().ok_or_else(cut)?;
                schemas.insert(id, name);
            }
            CHANNEL => {
                let (id, schema, name, encoding) = data.channel().ok_or_else(cut)?;
                let schema = schemas.get(&schema).map_or("", String::as_str);
                // The summary repeats them.
                channels.entry(id).or_insert_with(|| Channel::new(name, schema, &encoding, wanted));
            }
            MESSAGE => {
                has_messages = true;
                let (id, time_ns, data) = data.message().ok_or_else(cut)?;
                let unknown = || damaged(format!("a message is of channel {id}, which is not described"));
                let channel = channels.get(&id).ok_or_else(unknown)?;
                if channel.is_wanted {
                    let Channel { stream, layout, .. } = channel;
                    let packet = Packet { stream, layout: *layout, time_ns, data: Cow::Borrowed(data) };
                    if visitor(packet)?.is_break() {
                        return Ok(End::Stopped);
                    }
                }
            }
            _ => {}
        }
    }
    Ok(End::Whole)
}

/// The fields of a record, little-endian and without padding. `None` where it ends before them.
struct Record<'a> {
    rest: &'a [u8],
}

impl<'a> Record<'a> {
    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, after) = self.rest.split_first_chunk()?;
        self.rest = after;
        Some(*bytes)
    }

    fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    fn string(&mut self) -> Option<String> {
        let length = u32::from_le_bytes(self.number()?) as usize;
        let (bytes, after) = self.rest.split_at_checked(length)?;
        self.rest = after;
        Some(String::from_utf8_lossy(bytes).into_owned())
    }

    /// Identifier and name.
    fn schema(mut self) -> Option<(u16, String)> {
        Some((self.u16()?, self.string()?))
    }

    /// Identifier, that of the schema, topic and encoding of the messages.
    fn channel(mut self) -> Option<(u16, u16, String, String)> {
        Some((self.u16()?, self.u16()?, self.string()?, self.string()?))
    }

    /// Identifier of the channel, time of recording in ns, and the message.
    fn message(mut self) -> Option<(u16, u64, &'a [u8])> {
        let channel = self.u16()?;
        let _sequence: [u8; 4] = self.number()?;
        let time_ns = u64::from_le_bytes(self.number()?);
        let _published: [u8; 8] = self.number()?;
        Some((channel, time_ns, self.rest))
    }
}
