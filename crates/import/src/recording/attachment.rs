//! Files attached to a Matroska file (RFC 9559, section 5.1.6).
//!
//! The walk reads identifiers and sizes, and goes into the elements on the way to attachments only. It allocates nothing but the
//! attachment, which is within the file.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek};

use super::packet::Source;
use crate::error::ImportError;

const SEGMENT: u32 = 0x1853_8067;
const CLUSTER: u32 = 0x1f43_b675;
const ATTACHMENTS: u32 = 0x1941_a469;
const ATTACHED_FILE: u32 = 0x61a7;
const FILE_NAME: u32 = 0x466e;
const FILE_DATA: u32 = 0x465c;

/// Longest name and largest file that are read, bytes: a calibration has some kilobytes.
const LONGEST_NAME: u64 = 4096;
const LARGEST: u64 = 16 << 20;

/// The contents of the attachment `name`; `None` where there is none.
pub(super) fn attachment(source: Source<'_>, name: &str) -> Result<Option<Vec<u8>>, ImportError> {
    let file = File::open(source.file).map_err(|error| source.unreadable(error))?;
    let length = file.metadata().map_err(|error| source.unreadable(error))?.len();
    match find(&mut BufReader::new(file), length, name) {
        Ok(found) => Ok(found),
        Err(error) if error.kind() == io::ErrorKind::InvalidData => Err(source.damaged("Matroska file", error)),
        Err(error) => Err(source.unreadable(error)),
    }
}

/// The attached file that is being read, as far as it is known: whether its name is the one looked for, and place and size of its
/// contents.
#[derive(Default)]
struct Attached {
    is_it: bool,
    data: Option<(u64, u64)>,
}

fn find(reader: &mut (impl Read + Seek), length: u64, name: &str) -> io::Result<Option<Vec<u8>>> {
    let invalid = |problem: &str| io::Error::new(io::ErrorKind::InvalidData, problem);
    let mut attached = Attached::default();
    let mut position = 0_u64;
    while let Some((id, size, header)) = element(reader)? {
        position += header;
        let is_entered = match id {
            SEGMENT | ATTACHMENTS => true,
            ATTACHED_FILE => {
                attached = Attached::default();
                true
            }
            // Live recordings do not know the sizes of their clusters, whose end is the next.
            CLUSTER => size.is_none(),
            _ => false,
        };
        if is_entered {
            continue;
        }
        let size = size.ok_or_else(|| invalid("the size of an element is unknown"))?;
        // What is cut off has no attachments behind it.
        let Some(end) = position.checked_add(size).filter(|end| *end <= length) else { return Ok(None) };
        match id {
            FILE_NAME if size <= LONGEST_NAME => {
                let mut text = vec![0; size as usize];
                reader.read_exact(&mut text)?;
                attached.is_it = String::from_utf8_lossy(&text).trim_end_matches('\0') == name;
                position = end;
            }
            FILE_DATA => attached.data = Some((position, size)),
            _ => {}
        }
        if let Attached { is_it: true, data: Some((start, size)) } = attached {
            if size > LARGEST {
                return Err(invalid("its calibration is implausibly large"));
            }
            reader.seek(io::SeekFrom::Start(start))?;
            let mut data = vec![0; size as usize];
            reader.read_exact(&mut data)?;
            return Ok(Some(data));
        }
        // Within the file, hence within i64.
        reader.seek_relative((end - position) as i64)?;
        position = end;
    }
    Ok(None)
}

/// Identifier, size (`None` where it is unknown) and bytes of the next element's header; `None` at the end of the file.
fn element(reader: &mut impl Read) -> io::Result<Option<(u32, Option<u64>, u64)>> {
    let Some((id, id_bytes)) = number(reader, 4, false)? else { return Ok(None) };
    let Some((size, size_bytes)) = number(reader, 8, true)? else { return Ok(None) };
    let is_unknown = size == (1 << (7 * size_bytes)) - 1;
    // Identifiers have at most four bytes.
    Ok(Some((id as u32, (!is_unknown).then_some(size), id_bytes + size_bytes)))
}

/// A number of at most `most` bytes, whose count is that of the leading zeros of the first byte, with or without the bit that
/// marks it.
fn number(reader: &mut impl Read, most: u64, without_mark: bool) -> io::Result<Option<(u64, u64)>> {
    let mut first = [0];
    if reader.read(&mut first)? == 0 {
        return Ok(None);
    }
    let bytes = u64::from(first[0].leading_zeros()) + 1;
    if bytes > most {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "an element has no valid identifier or size"));
    }
    let mut value = u64::from(first[0]);
    if without_mark {
        value &= (1 << (8 - bytes)) - 1;
    }
    for _ in 1..bytes {
        let mut next = [0];
        if reader.read(&mut next)? == 0 {
            return Ok(None);
        }
        value = value << 8 | u64::from(next[0]);
    }
    Ok(Some((value, bytes)))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn element(id: &[u8], data: &[u8]) -> Vec<u8> {
        [id, &[0x40 | (data.len() >> 8) as u8, data.len() as u8], data].concat()
    }

    fn attached(parts: &[Vec<u8>]) -> Vec<u8> {
        let file = element(&[0x61, 0xa7], &parts.concat());
        let segment = [element(&[0xec], &[0; 9]), element(&[0x19, 0x41, 0xa4, 0x69], &file)].concat();
        [element(&[0x1a, 0x45, 0xdf, 0xa3], &[0; 3]), element(&[0x18, 0x53, 0x80, 0x67], &segment)].concat()
    }

    fn found(bytes: &[u8]) -> io::Result<Option<Vec<u8>>> {
        find(&mut Cursor::new(bytes), bytes.len() as u64, "a.json")
    }

    #[test]
    fn the_name_may_come_before_or_behind_the_contents() {
        let (name, data) = (element(&[0x46, 0x6e], b"a.json"), element(&[0x46, 0x5c], b"{}"));
        for parts in [[name.clone(), data.clone()], [data.clone(), name]] {
            assert_eq!(found(&attached(&parts)).unwrap().unwrap(), b"{}");
        }
        let other = element(&[0x46, 0x6e], b"b.json");
        assert_eq!(found(&attached(&[other, data])).unwrap(), None);
    }

    #[test]
    fn sizes_beyond_the_file_are_no_allocation() {
        // Eight bytes of size claim 2⁵⁶ − 2 bytes of contents.
        let claim = [&[0x46, 0x5c, 0x01][..], &[0xff; 6], &[0xfe]].concat();
        let name = element(&[0x46, 0x6e], b"a.json");
        assert_eq!(found(&[name, claim].concat()).unwrap(), None);
        assert_eq!(found(&[0]).unwrap_err().kind(), io::ErrorKind::InvalidData);
        assert_eq!(found(&[0x18, 0x53]).unwrap(), None);
    }
}
