//! Binary PGM (`P5`) and PPM (`P6`), 8 or 16 bits.

use std::path::Path;

use super::decoded::{Decoded, Values};
use super::depth_frame::{DepthFrame, DepthValues};
use super::error::ImageError;
use super::pixels::pixels;

pub(crate) fn is_pnm(bytes: &[u8]) -> bool {
    (bytes.starts_with(b"P5") || bytes.starts_with(b"P6"))
        && bytes.get(2).is_some_and(|byte| byte.is_ascii_whitespace() || *byte == b'#')
}

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Decoded, ImageError> {
    let (format, channels) = if bytes.starts_with(b"P6") { ("PPM", 3) } else { ("PGM", 1) };
    let damaged = |message: String| ImageError::Damaged { path: path.to_owned(), format, message };
    let mut unread = bytes.get(2..).unwrap_or_default();
    let mut number = |what: &str| next_number(&mut unread).ok_or_else(|| damaged(format!("its header has no {what}")));
    let (width, height, greatest) = (number("width")?, number("height")?, number("greatest value")?);
    if !(1..=65535).contains(&greatest) {
        return Err(damaged(format!("its greatest value is {greatest}, expected 1 … 65535")));
    }
    let count = channels * pixels(path, width, height)?;
    // A single white space ends the header; what follows is data even if it looks like white space.
    let samples = unread.get(1..).unwrap_or_default();
    let size = if greatest < 256 { 1 } else { 2 };
    let Some(samples) = samples.get(..count * size) else {
        return Err(damaged(format!("it has {} bytes of {}", samples.len(), count * size)));
    };
    let values = if size == 1 {
        Values::U8(samples.to_vec())
    } else {
        Values::U16(samples.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect())
    };
    Ok(Decoded { width, height, channels, values, format })
}

/// The bytes of a 16-bit PGM.
pub(crate) fn encode(frame: &DepthFrame) -> Result<Vec<u8>, String> {
    let DepthValues::Steps(values) = &frame.values else {
        return Err("is floating-point, which a PGM cannot hold: write TIFF, NPY or EXR".into());
    };
    let mut bytes = format!("P5\n{} {}\n65535\n", frame.width, frame.height).into_bytes();
    bytes.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    Ok(bytes)
}

/// Removes white space, comments and a decimal number from the front of `rest`, and returns the number.
fn next_number(unread: &mut &[u8]) -> Option<usize> {
    loop {
        match unread.first()? {
            b'#' => *unread = &unread[unread.iter().position(|byte| *byte == b'\n')?..],
            byte if byte.is_ascii_whitespace() => *unread = &unread[1..],
            _ => break,
        }
    }
    let end = unread.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(unread.len());
    let (digits, tail) = unread.split_at(end);
    *unread = tail;
    std::str::from_utf8(digits).ok()?.parse().ok()
}
