//! Image files: grey from PNG, JPEG and PGM, depth from 16-bit grey PNG.

use std::fs;
use std::path::Path;

use super::error::ImageError;
use super::raster::{DepthImage, GrayImage, RgbImage};
use super::{jpeg, pgm, png16};
use crate::file::FileError;

/// Reads an image as grey values: PNG (grey of 1 to 16 bits, RGB, RGBA, palette), JPEG, or binary PGM.
///
/// The format is recognised by the contents, not by the name. Colour becomes luma 0.299 R + 0.587 G + 0.114 B,
/// transparency is ignored, values of fewer than 8 bits are scaled to 8.
///
/// # Errors
/// [`ImageError`] with the file: it cannot be read, is damaged or truncated, or has another format.
pub fn read_gray(path: impl AsRef<Path>) -> Result<GrayImage, ImageError> {
    let path = path.as_ref();
    decode_gray(path, &read(path)?)
}

/// Reads a colour image, PNG or JPEG. Grey values become three equal channels; of 16 bits the upper 8 are kept.
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

/// Reads a depth image: a 16-bit grey PNG.
///
/// # Errors
/// [`ImageError::NotDepth`] says what the file is when it is not a 16-bit grey PNG; otherwise as [`read_gray`].
pub fn read_depth(path: impl AsRef<Path>) -> Result<DepthImage, ImageError> {
    let path = path.as_ref();
    decode_depth(path, &read(path)?)
}

/// Writes a depth image as 16-bit grey PNG, atomically.
///
/// # Errors
/// [`FileError::Invalid`] when the data do not have width × height values; [`FileError::Write`].
pub fn write_depth(path: impl AsRef<Path>, depth: &DepthImage) -> Result<(), FileError> {
    png16::write(path.as_ref(), [depth.width, depth.height], &depth.data, 16)
}

/// Writes a grey image as PNG with the image's 8 or 16 bits, atomically.
///
/// # Errors
/// [`FileError::Invalid`] when the data do not have width × height values of that many bits; [`FileError::Write`].
pub fn write_gray(path: impl AsRef<Path>, image: &GrayImage) -> Result<(), FileError> {
    png16::write(path.as_ref(), [image.width, image.height], &image.data, image.bits)
}

/// Checks that image and depth image of a frame have the same size; the paths are for the error's message.
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

#[cfg(test)]
mod tests;
