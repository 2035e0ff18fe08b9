//! Binary PGM (`P5`), 8 or 16 bits.

use std::path::Path;

use super::error::ImageError;
use super::pixels::pixels;
use super::raster::GrayImage;

pub(crate) fn is_pgm(bytes: &[u8]) -> bool {
    bytes.starts_with(b"P5") && bytes.get(2).is_some_and(|byte| byte.is_ascii_whitespace() || *byte == b'#')
}

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<GrayImage, ImageError> {
    let damaged = |message: String| ImageError::Damaged { path: path.to_owned(), format: "PGM", message };
    let mut rest = bytes.get(2..).unwrap_or_default();
    let mut number = |what: &str| next_number(&mut rest).ok_or_else(|| damaged(format!("its header has no {what}")));
    let (width, height, greatest) = (number("width")?, number("height")?, number("greatest value")?);
    if !(1..=65535).contains(&greatest) {
        return Err(damaged(format!("its greatest value is {greatest}, expected 1 … 65535")));
    }
    let count = pixels(path, width, height)?;
    // A single white space ends the header; what follows is data even if it looks like white space.
    let samples = rest.get(1..).unwrap_or_default();
    let size = if greatest < 256 { 1 } else { 2 };
    let Some(samples) = samples.get(..count * size) else {
        return Err(damaged(format!("it has {} bytes of {}", samples.len(), count * size)));
    };
    let data = if size == 1 {
        samples.iter().map(|byte| u16::from(*byte)).collect()
    } else {
        samples.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()
    };
    Ok(GrayImage { width, height, data, bits: if size == 1 { 8 } else { 16 } })
}

/// Removes white space, comments and a decimal number from the front of `rest`, and returns the number.
fn next_number(rest: &mut &[u8]) -> Option<usize> {
    loop {
        match rest.first()? {
            b'#' => *rest = &rest[rest.iter().position(|byte| *byte == b'\n')?..],
            byte if byte.is_ascii_whitespace() => *rest = &rest[1..],
            _ => break,
        }
    }
    let end = rest.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(rest.len());
    let (digits, tail) = rest.split_at(end);
    *rest = tail;
    std::str::from_utf8(digits).ok()?.parse().ok()
}
