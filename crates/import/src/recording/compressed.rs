//! Files and messages that ROS 2 compresses by zstd.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Write};

use tempfile::NamedTempFile;

/// Bytes per compressed byte, at most, and bytes of a message: images of one grey value shrink to a thousandth.
const LARGEST_RATIO: u64 = 1024;
const LARGEST: u64 = 1 << 30;

/// Whether bytes begin as a frame of zstd does (RFC 8878).
pub(super) fn is_zstd(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x28, 0xb5, 0x2f, 0xfd])
}

/// The contents of a compressed file in a file of their own, and whether they are all of them.
pub(super) fn unpacked(file: File) -> io::Result<(NamedTempFile, bool)> {
    let limit = file.metadata()?.len().saturating_mul(LARGEST_RATIO);
    let mut decoder = zstd::Decoder::new(BufReader::new(file))?.take(limit);
    let mut contents = NamedTempFile::new()?;
    let mut buffer = vec![0; 1 << 16];
    loop {
        match decoder.read(&mut buffer) {
            Ok(0) => return Ok((contents, decoder.limit() > 0)),
            Ok(count) => contents.write_all(&buffer[..count])?,
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok((contents, false)),
            Err(error) => return Err(error),
        }
    }
}

/// The contents of a compressed message.
pub(super) fn message(data: &[u8]) -> io::Result<Vec<u8>> {
    let limit = (data.len() as u64).saturating_mul(LARGEST_RATIO).min(LARGEST);
    let mut contents = Vec::new();
    zstd::Decoder::with_buffer(data)?.take(limit).read_to_end(&mut contents)?;
    Ok(contents)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_back_and_bombs_do_not() {
        let text = b"the same again and again, the same again and again".repeat(20);
        let packed = zstd::encode_all(&text[..], 3).unwrap();
        assert!(is_zstd(&packed) && message(&packed).unwrap() == text);
        let bomb = zstd::encode_all(io::repeat(0).take(1 << 26), 19).unwrap();
        assert!(message(&bomb).unwrap().len() <= 1024 * bomb.len());
        assert!(message(&packed[..packed.len() - 3]).is_err());
    }

    #[test]
    fn a_file_that_is_cut_off_gives_what_it_has() {
        // Marsaglia's xorshift: what cannot be compressed fills many blocks.
        let mut state = 1_u32;
        let mut byte = || {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state as u8
        };
        let noise: Vec<u8> = (0..1 << 20).map(|_| byte()).collect();
        let packed = zstd::encode_all(&noise[..], 1).unwrap();
        let written = |bytes: &[u8]| {
            let mut file = NamedTempFile::new().unwrap();
            file.write_all(bytes).unwrap();
            let (contents, is_whole) = unpacked(file.reopen().unwrap()).unwrap();
            (std::fs::read(contents.path()).unwrap(), is_whole)
        };
        assert_eq!(written(&packed), (noise.clone(), true));
        let (part, is_whole) = written(&packed[..packed.len() / 2]);
        assert!(!is_whole && part.len() > noise.len() / 4 && noise.starts_with(&part));
    }
}
