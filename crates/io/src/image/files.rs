//! Image files: grey from PNG, JPEG and PGM, depth from 16-bit grey PNG.

use std::fs;
use std::path::Path;

use crate::{DepthImage, FileError, GrayImage, ImageError, RgbImage, jpeg, pgm, png16};

/// Pixels beyond which an image is taken for damaged, so that a broken header does not ask for all memory.
const MAX_PIXELS: usize = 1 << 28;

/// Reads an image as grey values: PNG (grey of 1 to 16 bits, RGB, RGBA, palette), JPEG, or binary PGM.
///
/// The format is told by the contents, not by the name. Colour becomes luma 0.299 R + 0.587 G + 0.114 B, transparency
/// is ignored, values of fewer than 8 bits are stretched to 8.
///
/// # Errors
/// [`ImageError`] with the file: unreadable, damaged or truncated, or of another format.
pub fn read_gray(path: impl AsRef<Path>) -> Result<GrayImage, ImageError> {
    let path = path.as_ref();
    decode_gray(path, &read(path)?)
}

/// Reads a colour image: PNG or JPEG; grey values become equal channels, 16 bits the upper 8.
///
/// # Errors
/// As [`read_gray`].
pub fn read_rgb(path: impl AsRef<Path>) -> Result<RgbImage, ImageError> {
    let path = path.as_ref();
    let bytes = read(path)?;
    if png16::is_png(&bytes) {
        png16::decode_rgb(path, &bytes)
    } else if jpeg::is_jpeg(&bytes) {
        jpeg::decode_rgb(path, &bytes)
    } else {
        Err(ImageError::UnknownFormat { path: path.to_owned(), expected: "PNG or JPEG" })
    }
}

/// Reads a depth image.
///
/// # Errors
/// [`ImageError::NotDepth`] says what the file is where it is no 16-bit grey PNG; else as [`read_gray`].
pub fn read_depth(path: impl AsRef<Path>) -> Result<DepthImage, ImageError> {
    let path = path.as_ref();
    decode_depth(path, &read(path)?)
}

/// Writes a depth image as 16-bit grey PNG, atomically.
///
/// # Errors
/// [`FileError::Invalid`] where the data do not have width × height values, [`FileError::Write`].
pub fn write_depth(path: impl AsRef<Path>, depth: &DepthImage) -> Result<(), FileError> {
    png16::write(path.as_ref(), [depth.width, depth.height], &depth.data, 16)
}

/// Writes a grey image as PNG with the image's 8 or 16 bits, atomically.
///
/// # Errors
/// [`FileError::Invalid`] where the data do not have width × height values of that many bits, [`FileError::Write`].
pub fn write_gray(path: impl AsRef<Path>, image: &GrayImage) -> Result<(), FileError> {
    png16::write(path.as_ref(), [image.width, image.height], &image.data, image.bits)
}

/// Checks that image and depth of a frame have the same size. The paths are those of the error's message.
///
/// # Errors
/// [`ImageError::SizesDiffer`] names both files and both sizes.
pub fn check_same_size(image: (&Path, &GrayImage), depth: (&Path, &DepthImage)) -> Result<(), ImageError> {
    let image_size = [image.1.width, image.1.height];
    let depth_size = [depth.1.width, depth.1.height];
    if image_size == depth_size {
        return Ok(());
    }
    Err(ImageError::SizesDiffer { image: image.0.to_owned(), image_size, depth: depth.0.to_owned(), depth_size })
}

fn read(path: &Path) -> Result<Vec<u8>, ImageError> {
    fs::read(path).map_err(|error| ImageError::Read { path: path.to_owned(), error })
}

fn decode_gray(path: &Path, bytes: &[u8]) -> Result<GrayImage, ImageError> {
    if png16::is_png(bytes) {
        png16::decode(path, bytes)
    } else if jpeg::is_jpeg(bytes) {
        jpeg::decode(path, bytes)
    } else if pgm::is_pgm(bytes) {
        pgm::decode(path, bytes)
    } else if bytes.is_empty() {
        Err(ImageError::Unsupported {
            path: path.to_owned(),
            problem: "the file is empty; copy or capture it anew".into(),
        })
    } else {
        Err(ImageError::UnknownFormat { path: path.to_owned(), expected: "PNG, JPEG or binary PGM (P5)" })
    }
}

fn decode_depth(path: &Path, bytes: &[u8]) -> Result<DepthImage, ImageError> {
    if png16::is_png(bytes) {
        return png16::decode_depth(path, bytes);
    }
    let found = if jpeg::is_jpeg(bytes) {
        "a JPEG, which changes the values"
    } else if pgm::is_pgm(bytes) {
        "a PGM"
    } else if bytes.is_empty() {
        "an empty file"
    } else {
        "no PNG"
    };
    Err(ImageError::NotDepth { path: path.to_owned(), found: found.into() })
}

/// Number of pixels, or an error where the size is 0 or not believable.
pub(crate) fn pixels(path: &Path, width: usize, height: usize) -> Result<usize, ImageError> {
    match width.checked_mul(height) {
        Some(pixels) if (1..=MAX_PIXELS).contains(&pixels) => Ok(pixels),
        _ => Err(ImageError::Unsupported {
            path: path.to_owned(),
            problem: format!("the image claims {width}×{height} pixels, which is not believable; is it damaged?"),
        }),
    }
}

/// Luma of a colour, by the weights of ITU-R BT.601.
pub(crate) fn luma([r, g, b]: [u16; 3]) -> u16 {
    ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u16
}

#[cfg(test)]
mod tests;
