//! Containers of recordings, written by their definitions.

use std::io::Write;
use std::path::Path;

use super::messages::{Body, Message};

/// The topics in the order of their first messages.
fn topics(messages: &[Message]) -> Vec<&Message> {
    let mut topics: Vec<&Message> = Vec::new();
    for message in messages {
        if !topics.iter().any(|known| known.topic == message.topic) {
            topics.push(message);
        }
    }
    topics
}

fn number_of(topics: &[&Message], message: &Message) -> usize {
    topics.iter().position(|known| known.topic == message.topic).unwrap()
}

/// A bag of ROS 1 (wiki.ros.org/Bags/Format/2.0), a chunk per message, compressed by bzip2 or not; one whose recording was
/// interrupted has no index.
pub fn bag(messages: &[Message], is_compressed: bool, is_interrupted: bool) -> Vec<u8> {
    let fields = |fields: &[&[u8]]| -> Vec<u8> {
        let all = fields.iter().flat_map(|field| [&(field.len() as u32).to_le_bytes(), *field].concat());
        all.collect()
    };
    let record = |header: Vec<u8>, data: &[u8]| {
        let lengths = [header.len(), data.len()].map(|n| (n as u32).to_le_bytes());
        [&lengths[0][..], &header, &lengths[1], data].concat()
    };
    let topics = topics(messages);
    let mut chunks = Vec::new();
    for message in messages {
        let conn = [&b"conn="[..], &(number_of(&topics, message) as u32).to_le_bytes()].concat();
        let topic = format!("topic={}", message.topic);
        let kind = format!("type={}", message.kind(true));
        let connection =
            record(fields(&[b"op=\x07", &conn, topic.as_bytes()]), &fields(&[kind.as_bytes(), b"md5sum=*"]));
        let [seconds, nanoseconds] =
            [message.time_ns / 1_000_000_000, message.time_ns % 1_000_000_000].map(|t| t as u32);
        let time = [&b"time="[..], &seconds.to_le_bytes(), &nanoseconds.to_le_bytes()].concat();
        let data = record(fields(&[b"op=\x02", &conn, &time]), &message.bytes(true));
        let records = [connection, data].concat();
        let size = [&b"size="[..], &(records.len() as u32).to_le_bytes()].concat();
        if is_compressed {
            let mut packed = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            packed.write_all(&records).unwrap();
            chunks.extend(record(fields(&[b"op=\x05", b"compression=bz2", &size]), &packed.finish().unwrap()));
        } else {
            chunks.extend(record(fields(&[b"op=\x05", b"compression=none", &size]), &records));
        }
    }
    const FIRST: usize = 4096;
    let index = if is_interrupted { 0 } else { (13 + 4 + FIRST + chunks.len()) as u64 };
    let position = [&b"index_pos="[..], &index.to_le_bytes()].concat();
    let head = fields(&[b"op=\x03", &position, b"conn_count=\0\0\0\0", b"chunk_count=\0\0\0\0"]);
    let padding = vec![b' '; FIRST - head.len() - 4];
    [b"#ROSBAG V2.0\n".to_vec(), record(head, &padding), chunks].concat()
}

/// An MCAP (mcap.dev/spec) without chunks, of ROS 2; each message may be compressed, as rosbag2's mode `message` does.
pub fn mcap(messages: &[Message], is_compressed: bool) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let record = |op: u8, data: Vec<u8>| [&[op][..], &(data.len() as u64).to_le_bytes(), &data].concat();
    let id = |number: usize| (number as u16).to_le_bytes().to_vec();
    let magic = b"\x89MCAP0\r\n".to_vec();
    let topics = topics(messages);
    let mut records = vec![record(1, [text("ros2"), text("")].concat())];
    for (number, topic) in topics.iter().enumerate() {
        records.push(record(3, [id(number + 1), text(&topic.kind(false)), text("ros2msg"), text("")].concat()));
        let channel = [id(number), id(number + 1), text(&topic.topic), text("cdr"), vec![0; 4]];
        records.push(record(4, channel.concat()));
    }
    for message in messages {
        let time = message.time_ns.to_le_bytes().to_vec();
        let head = [id(number_of(&topics, message)), vec![0; 4], time.clone(), time];
        records.push(record(5, [head.concat(), packed(message, is_compressed)].concat()));
    }
    records.push(record(15, vec![0; 4]));
    records.push(record(2, vec![0; 20]));
    [vec![magic.clone()], records, vec![magic]].concat().concat()
}

fn packed(message: &Message, is_compressed: bool) -> Vec<u8> {
    let bytes = message.bytes(false);
    if is_compressed { zstd::encode_all(&bytes[..], 1).unwrap() } else { bytes }
}

/// A bag of ROS 2 in SQLite (rosbag2_storage_sqlite3).
pub fn db3(path: &Path, messages: &[Message], is_compressed: bool) {
    let database = rusqlite::Connection::open(path).unwrap();
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT \
                  NULL, offered_qos_profiles TEXT NOT NULL);
                  CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
                  CREATE INDEX timestamp_idx ON messages (timestamp ASC);";
    database.execute_batch(tables).unwrap();
    let topics = topics(messages);
    for (number, topic) in topics.iter().enumerate() {
        let row = (number as i64 + 1, &topic.topic, topic.kind(false));
        database.execute("INSERT INTO topics VALUES(?1, ?2, ?3, 'cdr', '')", row).unwrap();
    }
    for message in messages {
        let row = (number_of(&topics, message) as i64 + 1, message.time_ns as i64, packed(message, is_compressed));
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?1, ?2, ?3)", row).unwrap();
    }
}

/// A Matroska file of 16-bit tracks, as the recorder of the Azure Kinect writes it (RFC 9559), a cluster per frame.
pub fn mkv(messages: &[Message]) -> Vec<u8> {
    let element = |id: &[u8], data: &[u8]| -> Vec<u8> {
        let size = (data.len() as u64 | 1 << 56).to_be_bytes();
        [id, &size, data].concat()
    };
    let images: Vec<&Message> = messages.iter().filter(|m| matches!(m.body, Body::Image { .. })).collect();
    let mut tracks = Vec::new();
    let names = topics(messages).into_iter().filter(|m| matches!(m.body, Body::Image { .. })).collect::<Vec<_>>();
    for (number, track) in names.iter().enumerate() {
        let Body::Image { size: [width, height], .. } = &track.body else { continue };
        let code = [&[0; 16][..], b"b16g", &[0; 20]].concat();
        let sides =
            [element(&[0xb0], &(*width as u16).to_be_bytes()), element(&[0xba], &(*height as u16).to_be_bytes())];
        let id = [number as u8 + 1];
        let entry = [
            element(&[0xd7], &id),
            element(&[0x73, 0xc5], &id),
            element(&[0x83], &[1]),
            element(&[0x53, 0x6e], track.topic.as_bytes()),
            element(&[0x86], b"V_MS/VFW/FOURCC"),
            element(&[0x63, 0xa2], &code),
            element(&[0xe0], &sides.concat()),
        ];
        tracks.extend(element(&[0xae], &entry.concat()));
    }
    let scale = element(&[0x2a, 0xd7, 0xb1], &1_000_000_u32.to_be_bytes());
    let info = [scale, element(&[0x4d, 0x80], b"x"), element(&[0x57, 0x41], b"x")].concat();
    let mut segment = [element(&[0x15, 0x49, 0xa9, 0x66], &info), element(&[0x16, 0x54, 0xae, 0x6b], &tracks)].concat();
    for image in images {
        let Body::Image { data, .. } = &image.body else { continue };
        // Big-endian in the file.
        let data: Vec<u8> = data.as_chunks::<2>().0.iter().flat_map(|[low, high]| [*high, *low]).collect();
        let block = [&[0x81 + number_of(&names, image) as u8, 0, 0, 0x80][..], &data].concat();
        let time = element(&[0xe7], &((image.time_ns / 1_000_000) as u32).to_be_bytes());
        segment.extend(element(&[0x1f, 0x43, 0xb6, 0x75], &[time, element(&[0xa3], &block)].concat()));
    }
    let kind = [element(&[0x42, 0x82], b"matroska"), element(&[0x42, 0x87], &[4]), element(&[0x42, 0x85], &[2])];
    [element(&[0x1a, 0x45, 0xdf, 0xa3], &kind.concat()), element(&[0x18, 0x53, 0x80, 0x67], &segment)].concat()
}
