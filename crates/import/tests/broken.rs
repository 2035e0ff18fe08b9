//! Recordings that claim more than they hold, or are wrong in places that their readers take on trust: errors that name the file,
//! without a panic and without memory.

use std::path::PathBuf;

use depthcal_import::{ImportOptions, import};

/// The error of importing these bytes, as text.
fn complaint(name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let error = import(&path, &folder.path().join("out"), &ImportOptions::default()).unwrap_err().to_string();
    assert!(error.contains(name), "{error}");
    error
}

fn mcap(records: &[u8]) -> Vec<u8> {
    [b"\x89MCAP0\r\n", records].concat()
}

fn record(op: u8, length: u64, data: &[u8]) -> Vec<u8> {
    [&[op][..], &length.to_le_bytes(), data].concat()
}

/// A chunk without compression that holds `records`.
fn chunk(records: &[u8]) -> Vec<u8> {
    let size = (records.len() as u64).to_le_bytes();
    let head = [&[0; 16][..], &size, &[0; 8], &size].concat();
    record(6, (head.len() + records.len()) as u64, &[&head[..], records].concat())
}

#[test]
fn a_record_of_an_mcap_that_is_longer_than_the_file() {
    let message = complaint("long.mcap", &mcap(&record(5, 1 << 40, b"abc")));
    assert!(message.contains("this MCAP is damaged"), "{message}");
}

#[test]
fn strings_of_an_mcap_that_are_longer_than_their_record() {
    // Identifier, then a name of 2³² − 1 bytes.
    let schema = [&[1, 0][..], &[0xff; 4], b"abc"].concat();
    let message = complaint("name.mcap", &mcap(&record(3, schema.len() as u64, &schema)));
    assert!(message.contains("a record of type 3 is cut off"), "{message}");
}

#[test]
fn a_record_of_an_mcap_that_is_longer_than_its_chunk() {
    let mut chunk = chunk(&record(3, 5, &[1, 0, 1, 0, 0]));
    let inner = chunk.len() - 5 - 8;
    chunk[inner] = 200;
    let message = complaint("chunk.mcap", &mcap(&[chunk, vec![0; 100]].concat()));
    assert!(message.contains("this MCAP is damaged"), "{message}");
}

#[test]
fn a_message_of_an_mcap_without_its_channel() {
    let message = complaint("channel.mcap", &mcap(&record(5, 22, &[7; 22])));
    assert!(message.contains("channel 1799, which is not described"), "{message}");
}

#[test]
fn an_index_of_a_bag_beyond_its_end() {
    let header = |index: u64| bag(&index.to_le_bytes(), &[]);
    assert!(complaint("cut.bag", &header(1 << 40)).contains("cut off before its first message"));
    // An interrupted recording has no index.
    assert!(complaint("interrupted.bag", &header(0)).contains("there are no images"));
    assert!(complaint("early.bag", &header(20)).contains("reaches into the index"));
    assert!(complaint("none.bag", b"#ROSBAG V2.0\n\0\0\0\0\0\0\0\0").contains("does not say where the index is"));
    assert!(complaint("short.bag", b"#ROSBAG V2.0\n\x40\0\0\0").contains("cut off"));
}

#[test]
fn a_chunk_of_a_bag_that_claims_gigabytes() {
    let fields = [field(b"op=\x05"), field(b"compression=bz2"), field(b"size=\xff\xff\xff\xff")].concat();
    let chunk = [&(fields.len() as u32).to_le_bytes()[..], &fields, &4_u32.to_le_bytes(), b"BZh9"].concat();
    let index = bag(&[0; 8], &chunk).len() as u64;
    let message = complaint("claims.bag", &bag(&index.to_le_bytes(), &chunk));
    assert!(message.contains("claims 4294967295 bytes, made of 4"), "{message}");
}

fn field(text: &[u8]) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text].concat()
}

/// A bag whose first record says that the index begins at `index`, and these records behind it.
fn bag(index: &[u8; 8], records: &[u8]) -> Vec<u8> {
    let position = [&b"index_pos="[..], index].concat();
    let fields =
        [field(b"op=\x03"), field(&position), field(b"conn_count=\0\0\0\0"), field(b"chunk_count=\x01\0\0\0")].concat();
    let padding = 4096 - fields.len() - 8;
    let lengths = [fields.len() as u32, padding as u32].map(u32::to_le_bytes);
    [&b"#ROSBAG V2.0\n"[..], &lengths[0], &fields, &lengths[1], &vec![b' '; padding], records].concat()
}

/// An element of a Matroska file.
fn element(id: &[u8], data: &[u8]) -> Vec<u8> {
    [id, &[0x40 | (data.len() >> 8) as u8, data.len() as u8], data].concat()
}

/// A Matroska file of one segment.
fn matroska(segment: &[u8]) -> Vec<u8> {
    let kind =
        [element(&[0x42, 0x82], b"matroska"), element(&[0x42, 0x87], &[4]), element(&[0x42, 0x85], &[2])].concat();
    [element(&[0x1a, 0x45, 0xdf, 0xa3], &kind), element(&[0x18, 0x53, 0x80, 0x67], segment)].concat()
}

#[test]
fn a_table_of_contents_of_a_matroska_file_that_refers_to_itself() {
    const SEEK_HEAD: [u8; 4] = [0x11, 0x4d, 0x9b, 0x74];
    // The first element of the segment is itself.
    let entry = [element(&[0x53, 0xab], &SEEK_HEAD), element(&[0x53, 0xac], &[0])].concat();
    let message = complaint("circle.mkv", &matroska(&element(&SEEK_HEAD, &element(&[0x4d, 0xbb], &entry))));
    assert!(message.contains("leads back to the same places"), "{message}");
}

#[test]
fn a_track_of_a_matroska_file_that_is_wider_than_memory() {
    let code = [&[0; 16][..], b"b16g", &[0; 20]].concat();
    let size = [element(&[0xb0], &[0x7f; 8]), element(&[0xba], &[0x7f; 8])].concat();
    let track = [
        element(&[0xd7], &[1]),
        element(&[0x73, 0xc5], &[1]),
        element(&[0x83], &[1]),
        element(&[0x53, 0x6e], b"IR"),
        element(&[0x86], b"V_MS/VFW/FOURCC"),
        element(&[0x63, 0xa2], &code),
        element(&[0xe0], &size),
    ];
    let info =
        [element(&[0x2a, 0xd7, 0xb1], &[1]), element(&[0x4d, 0x80], b"x"), element(&[0x57, 0x41], b"x")].concat();
    let cluster = [element(&[0xe7], &[0]), element(&[0xa3], &[0x81, 0, 0, 0x80, 1, 2, 3, 4])].concat();
    let segment = [
        element(&[0x15, 0x49, 0xa9, 0x66], &info),
        element(&[0x16, 0x54, 0xae, 0x6b], &element(&[0xae], &track.concat())),
        element(&[0x1f, 0x43, 0xb6, 0x75], &cluster),
    ];
    let message = complaint("wide.mkv", &matroska(&segment.concat()));
    assert!(message.contains("stream IR") && message.contains("has 4 bytes"), "{message}");
}
