//! The number of an image's pixels, and grey values from colours.

use std::path::Path;

use super::error::ImageError;

/// Number of pixels above which a header counts as damaged, so that it cannot claim all memory.
pub(crate) const MAX_PIXELS: usize = 1 << 28;

/// Number of pixels; an error when the size is 0 or implausible.
pub(crate) fn pixels(path: &Path, width: usize, height: usize) -> Result<usize, ImageError> {
    match width.checked_mul(height) {
        Some(pixels) if (1..=MAX_PIXELS).contains(&pixels) => Ok(pixels),
        _ => Err(ImageError::Unsupported {
            path: path.to_owned(),
            problem: format!(
                "the image claims {width}×{height} pixels, which is implausible: copy or capture the file anew"
            ),
        }),
    }
}

/// Refuses a file of `length` bytes that claims `needed` bytes of pixels although its format compresses by `ratio` at most,
/// before memory is allocated for them.
pub(crate) fn fits(
    path: &Path,
    format: &'static str,
    needed: usize,
    ratio: usize,
    length: usize,
) -> Result<(), ImageError> {
    if needed / ratio <= length {
        return Ok(());
    }
    let message = format!("it is too short for the {needed} bytes of pixels that it claims");
    Err(ImageError::Damaged { path: path.to_owned(), format, message })
}

/// Luma of a colour, by the weights of ITU-R BT.601.
pub(crate) fn luma([r, g, b]: [u16; 3]) -> u16 {
    ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u16
}
