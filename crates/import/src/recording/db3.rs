//! ROS 2 bags in SQLite (`.db3`), by the `rusqlite` crate.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags};

use super::packet::{Layout, Packet, StreamInfo, Visitor, damaged, plain_type};
use crate::error::ImportError;

pub(super) fn visit(
    path: &Path,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<(), ImportError> {
    let fault = |error: rusqlite::Error| damaged(path, "ROS 2 bag", error);
    let database = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(fault)?;
    let mut topics = database.prepare("SELECT id, name, type, serialization_format FROM topics").map_err(fault)?;
    let mut rows = topics.query([]).map_err(fault)?;
    let mut streams: BTreeMap<i64, StreamInfo> = BTreeMap::new();
    while let Some(row) = rows.next().map_err(fault)? {
        let (id, name, kind, format): (i64, String, String, String) = (
            row.get(0).map_err(fault)?,
            row.get(1).map_err(fault)?,
            row.get(2).map_err(fault)?,
            row.get(3).map_err(fault)?,
        );
        let stream = StreamInfo { name, kind: plain_type(&kind) };
        if format == "cdr" && wanted(&stream) {
            streams.insert(id, stream);
        }
    }
    let mut messages =
        database.prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id").map_err(fault)?;
    let mut rows = messages.query([]).map_err(fault)?;
    while let Some(row) = rows.next().map_err(fault)? {
        let Some(stream) = streams.get(&row.get(0).map_err(fault)?) else { continue };
        let time: i64 = row.get(1).map_err(fault)?;
        let ValueRef::Blob(data) = row.get_ref(2).map_err(fault)? else {
            return Err(damaged(path, "ROS 2 bag", "a message is no blob"));
        };
        let packet = Packet { stream, layout: Layout::Cdr, time_ns: time.max(0) as u64, data: Cow::Borrowed(data) };
        if visitor(packet)?.is_break() {
            break;
        }
    }
    Ok(())
}
