//! ROS 2 bags in SQLite (`.db3`), by the `rusqlite` crate.

use std::borrow::Cow;
use std::collections::BTreeMap;

use rusqlite::limits::Limit;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, ErrorCode, OpenFlags, Rows};

use super::packet::{End, Layout, Packet, Source, StreamInfo, Visitor, plain_type};
use crate::error::ImportError;

/// Instructions of SQLite's machine per byte of the file: reading and sorting a message takes some tens, and none is that short.
/// A damaged file may have pages that contain themselves, and would be read for ever.
const INSTRUCTIONS_PER_BYTE: u64 = 100;
/// Instructions that every file may take, and how many are counted at a time.
const INSTRUCTIONS: u64 = 1_000_000;
const COUNTED: u64 = 10_000;
/// Longest value that every file may have, bytes; larger ones are within a file of their length.
const LONGEST: u64 = 1 << 20;

const KIND: &str = "ROS 2 bag";
/// Messages in the order of time. Of a file that is cut off, whose order would need all of it, those in the order of the file.
const ORDERED: &str = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id";
const STORED: &str = "SELECT topic_id, timestamp, data FROM messages ORDER BY id";

/// Opens the file, with limits to what it can make of its length.
fn open(source: Source<'_>) -> Result<Connection, ImportError> {
    let fault = |error: rusqlite::Error| source.damaged(KIND, error);
    let length = std::fs::metadata(source.file).map_err(|error| source.unreadable(error))?.len();
    let database = Connection::open_with_flags(source.file, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(fault)?;
    let longest = length.max(LONGEST).try_into().unwrap_or(i32::MAX);
    database.set_limit(Limit::SQLITE_LIMIT_LENGTH, longest).map_err(fault)?;
    let limit = INSTRUCTIONS + INSTRUCTIONS_PER_BYTE.saturating_mul(length);
    let mut count = 0;
    let is_enough = move || {
        count += COUNTED;
        count > limit
    };
    database.progress_handler(COUNTED as i32, Some(is_enough)).map_err(fault)?;
    // A view of these names could compute anything, as its own SQL says.
    let tables =
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND rootpage > 0 AND name IN ('topics', 'messages')";
    let tables = || database.query_row(tables, [], |row| row.get(0));
    let count: i64 = match tables() {
        // Its first page tells of more pages than there are. This is the pragma with which SQLite reads those that are.
        Err(error) if is_corrupt(&error) => {
            database.execute_batch("PRAGMA writable_schema = ON").map_err(fault)?;
            tables()
        }
        read => read,
    }
    .map_err(fault)?;
    if count != 2 {
        return Err(source.damaged(KIND, "it does not have the two tables topics and messages"));
    }
    Ok(database)
}

fn is_corrupt(error: &rusqlite::Error) -> bool {
    error.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt)
}

pub(super) fn visit(
    source: Source<'_>,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<End, ImportError> {
    let fault = |error: rusqlite::Error| source.damaged(KIND, error);
    let database = open(source)?;
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
    let mut ordered = database.prepare(ORDERED).map_err(fault)?;
    let mut has_messages = false;
    match messages(source, ordered.query([]).map_err(fault)?, &streams, &mut has_messages, visitor)? {
        // Sorting reads everything before the first message.
        End::Cut if !has_messages => {}
        end => return Ok(end),
    }
    let mut stored = database.prepare(STORED).map_err(fault)?;
    match messages(source, stored.query([]).map_err(fault)?, &streams, &mut has_messages, visitor)? {
        End::Cut if !has_messages => Err(source.damaged(KIND, "its first message cannot be read")),
        end => Ok(end),
    }
}

/// Calls the visitor with the messages, up to a page that is not there.
fn messages(
    source: Source<'_>,
    mut rows: Rows<'_>,
    streams: &BTreeMap<i64, StreamInfo>,
    has_messages: &mut bool,
    visitor: &mut Visitor<'_>,
) -> Result<End, ImportError> {
    let fault = |error: rusqlite::Error| source.damaged(KIND, error);
    loop {
        let row = match rows.next() {
            Ok(Some(row)) => row,
            Ok(None) => return Ok(End::Whole),
            Err(error) if is_corrupt(&error) => return Ok(End::Cut),
            Err(error) => return Err(fault(error)),
        };
        *has_messages = true;
        let Some(stream) = streams.get(&row.get(0).map_err(fault)?) else { continue };
        let time: i64 = row.get(1).map_err(fault)?;
        let ValueRef::Blob(data) = row.get_ref(2).map_err(fault)? else {
            return Err(source.damaged(KIND, "a message is no blob"));
        };
        let packet = Packet { stream, layout: Layout::Cdr, time_ns: time.max(0) as u64, data: Cow::Borrowed(data) };
        if visitor(packet)?.is_break() {
            return Ok(End::Stopped);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;

    const TOPICS: &str = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
        INSERT INTO topics VALUES(1, '/a', 'sensor_msgs/msg/Image', 'cdr');";

    fn complaint(sql: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.db3");
        Connection::open(&path).unwrap().execute_batch(&format!("{TOPICS}{sql}")).unwrap();
        let source = Source { file: &path, name: &path };
        let visited = visit(source, &|_| true, &mut |_| Ok(ControlFlow::Continue(())));
        visited.unwrap_err().to_string()
    }

    #[test]
    fn views_are_no_tables() {
        let message = complaint(
            "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
             SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n;",
        );
        assert!(message.contains("a.db3") && message.contains("two tables topics and messages"), "{message}");
    }

    #[test]
    fn values_that_the_file_does_not_hold_are_refused() {
        let message = complaint(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB AS (zeroblob(900000000)));
             INSERT INTO messages VALUES(1, 1, 1);",
        );
        assert!(message.contains("too big"), "{message}");
    }
}
