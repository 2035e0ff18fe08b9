//! Image files, recognised by their contents: grey, colour and depth.

use std::fs;
use std::path::Path;

use super::decoded::{self, Decoded};
use super::depth_frame::{DepthFrame, DepthValues};
use super::error::ImageError;
use super::npy::Wanted;
use super::raster::{DepthImage, GrayImage, RgbImage};
use super::{exr_file, jpeg, npy, png16, pnm, tiff_file};
use crate::file::{FileError, StandIn, write_atomically};

/// Formats that are read, for messages.
const KNOWN: &str = "PNG, JPEG, TIFF, EXR, NPY, NPZ or binary PGM or PPM (P5, P6)";

/// Extensions of the files that are read as images or depth.
pub const IMAGE_EXTENSIONS: &[&str] = &["png", "jpg", "jpeg", "tif", "tiff", "exr", "npy", "npz", "pgm", "ppm", "pnm"];

/// Extensions of the files that are read as depth.
pub const DEPTH_EXTENSIONS: &[&str] = &["png", "tif", "tiff", "exr", "npy", "npz", "pgm", "pnm"];

/// Reads an image as grey values: PNG (grey of 1 to 16 bits, RGB, RGBA, palette), JPEG, TIFF, EXR, NPY, NPZ, binary PGM or PPM.
///
/// The format is recognised by the contents, not by the name. Colour becomes luma 0.299 R + 0.587 G + 0.114 B,
/// transparency is ignored, values of fewer than 8 bits are scaled to 8, floating-point values within 0 … 1 to 16; others are
/// rounded.
///
/// # Errors
/// [`ImageError`] with the file: it cannot be read, is damaged or truncated, or has another format.
pub fn read_gray(path: impl AsRef<Path>) -> Result<GrayImage, ImageError> {
    let path = path.as_ref();
    decode_gray(path, &read(path)?)
}

/// Reads a colour image of any format that [`read_gray`] reads. Grey values become three equal channels; of 16 bits the upper 8
/// are kept.
///
/// # Errors
/// As [`read_gray`].
pub fn read_rgb(path: impl AsRef<Path>) -> Result<RgbImage, ImageError> {
    let path = path.as_ref();
    decode_rgb(path, &read(path)?)
}

/// Reads a depth image of 16-bit steps: a grey PNG, TIFF, NPY, NPZ, EXR or PGM of whole numbers.
///
/// # Errors
/// [`ImageError::NotDepth`] says what the file is when it holds no such depth, which includes floating-point depth (see
/// [`read_depth_frame`]); otherwise as [`read_gray`].
pub fn read_depth(path: impl AsRef<Path>) -> Result<DepthImage, ImageError> {
    let path = path.as_ref();
    let DepthFrame { width, height, values } = read_depth_frame(path)?;
    match values {
        DepthValues::Steps(data) => Ok(DepthImage { width, height, data }),
        DepthValues::Float(_) => Err(ImageError::NotDepth {
            path: path.to_owned(),
            found: "floating-point depth, read here as 16-bit steps".into(),
        }),
    }
}

/// Reads a depth image: one channel of 16-bit or floating-point values in a PNG, TIFF, EXR, NPY, NPZ or PGM. Whole numbers of
/// other types become 16-bit steps where they fit and floating-point numbers otherwise; the largest value of their type is no
/// measurement.
///
/// # Errors
/// [`ImageError::NotDepth`] says what the file is when it cannot hold depth; otherwise as [`read_gray`].
pub fn read_depth_frame(path: impl AsRef<Path>) -> Result<DepthFrame, ImageError> {
    let path = path.as_ref();
    decode_depth_frame(path, &read(path)?)
}

/// Writes a depth image as 16-bit grey PNG, atomically.
///
/// # Errors
/// [`FileError::Invalid`] when the data do not have width × height values; [`FileError::Write`].
pub fn write_depth(path: impl AsRef<Path>, depth: &DepthImage) -> Result<(), FileError> {
    png16::write(path.as_ref(), [depth.width, depth.height], &depth.data, 16)
}

/// Writes a depth image in the format of the path's extension, atomically: png and pgm (16-bit steps only), tif, tiff and npy
/// (the type of the values), exr (floating-point, channel Z).
///
/// # Errors
/// [`FileError::Invalid`] when the data do not have width × height values, the extension is another, or the format cannot hold
/// the values; [`FileError::Write`].
pub fn write_depth_frame(path: impl AsRef<Path>, depth: &DepthFrame) -> Result<(), FileError> {
    write_depth_frame_file(path.as_ref(), depth)
}

fn write_depth_frame_file(path: &Path, depth: &DepthFrame) -> Result<(), FileError> {
    let invalid = |problem: String| FileError::Invalid { path: path.to_owned(), field: "data".into(), problem };
    if depth.width.checked_mul(depth.height) != Some(depth.len()) || depth.is_empty() {
        return Err(invalid(format!("has {} values for {}×{} pixels", depth.len(), depth.width, depth.height)));
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let bytes = match (extension.as_str(), &depth.values) {
        ("png", DepthValues::Steps(values)) => return png16::write(path, [depth.width, depth.height], values, 16),
        ("png", DepthValues::Float(_)) => {
            Err("is floating-point, which a PNG cannot hold: write TIFF, NPY or EXR".into())
        }
        ("pgm", _) => pnm::encode(depth),
        ("tif" | "tiff", _) => tiff_file::encode(depth),
        ("npy", _) => npy::encode(depth),
        ("exr", _) => exr_file::encode(depth),
        (other, _) => Err(format!("cannot be written as `.{other}`: write png, pgm, tiff, npy or exr")),
    };
    let bytes = bytes.map_err(invalid)?;
    write_atomically(path, |writer| writer.write_all(&bytes))
}

/// Writes a grey image as PNG with the image's 8 or 16 bits, atomically.
///
/// # Errors
/// [`FileError::Invalid`] when the data do not have width × height values of that many bits; [`FileError::Write`].
pub fn write_gray(path: impl AsRef<Path>, image: &GrayImage) -> Result<(), FileError> {
    png16::write(path.as_ref(), [image.width, image.height], &image.data, image.bits)
}

/// Writes a colour image as PNG of 8 bits, atomically.
///
/// # Errors
/// [`FileError::Invalid`] when the data do not have width × height values; [`FileError::Write`].
pub fn write_rgb(path: impl AsRef<Path>, image: &RgbImage) -> Result<(), FileError> {
    png16::write_rgb(path.as_ref(), [image.width, image.height], image.data.as_flattened())
}

/// Checks that image and depth image of a frame have the same width and height; the paths are for the error's message.
///
/// # Errors
/// [`ImageError::SizesDiffer`] names both files and both sizes.
pub fn check_same_size(image: (&Path, [usize; 2]), depth: (&Path, [usize; 2])) -> Result<(), ImageError> {
    if image.1 == depth.1 {
        return Ok(());
    }
    Err(ImageError::SizesDiffer {
        image: image.0.to_owned(),
        image_size: image.1,
        depth: depth.0.to_owned(),
        depth_size: depth.1,
        // The image has been read before; a file that has vanished says nothing.
        orientation: fs::read(image.0)
            .ok()
            .as_deref()
            .and_then(jpeg::orientation)
            .filter(|orientation| *orientation != 1),
    })
}

fn read(path: &Path) -> Result<Vec<u8>, ImageError> {
    fs::read(path).map_err(|error| ImageError::Read { path: path.to_owned(), error })
}

/// Decodes the bytes of an image as [`read_gray`] does; `path` only names their source in errors.
///
/// # Errors
/// As [`read_gray`].
pub fn decode_gray(path: &Path, bytes: &[u8]) -> Result<GrayImage, ImageError> {
    if png16::is_png(bytes) {
        png16::decode(path, bytes)
    } else if jpeg::is_jpeg(bytes) {
        jpeg::decode(path, bytes)
    } else {
        decoded::gray(path, decode_other(path, bytes, Wanted::Image)?)
    }
}

/// Decodes the bytes of an image as [`read_rgb`] does; `path` only names their source in errors.
///
/// # Errors
/// As [`read_gray`].
pub fn decode_rgb(path: &Path, bytes: &[u8]) -> Result<RgbImage, ImageError> {
    if png16::is_png(bytes) {
        png16::decode_rgb(path, bytes)
    } else if jpeg::is_jpeg(bytes) {
        jpeg::decode_rgb(path, bytes)
    } else {
        decoded::rgb(path, decode_other(path, bytes, Wanted::Image)?)
    }
}

/// Decodes the bytes of a depth image as [`read_depth_frame`] does; `path` only names their source in errors.
///
/// # Errors
/// As [`read_depth_frame`].
pub fn decode_depth_frame(path: &Path, bytes: &[u8]) -> Result<DepthFrame, ImageError> {
    if png16::is_png(bytes) {
        return png16::decode_depth(path, bytes).map(DepthFrame::from);
    }
    let description = if jpeg::is_jpeg(bytes) {
        "a JPEG, which changes the values"
    } else if bytes.is_empty() {
        "an empty file"
    } else {
        return decoded::depth(path, decode_other(path, bytes, Wanted::Depth)?);
    };
    Err(ImageError::NotDepth { path: path.to_owned(), found: description.into() })
}

/// Decodes all formats but PNG and JPEG.
fn decode_other(path: &Path, bytes: &[u8], wanted: Wanted) -> Result<Decoded, ImageError> {
    if pnm::is_pnm(bytes) {
        pnm::decode(path, bytes)
    } else if tiff_file::is_tiff(bytes) {
        tiff_file::decode(path, bytes)
    } else if exr_file::is_exr(bytes) {
        exr_file::decode(path, bytes)
    } else if npy::is_npy(bytes) {
        npy::decode(path, bytes)
    } else if npy::is_npz(bytes) {
        npy::decode_archive(path, bytes, wanted)
    } else if bytes.is_empty() {
        Err(ImageError::Unsupported {
            path: path.to_owned(),
            problem: "the file is empty; copy or capture it anew".into(),
        })
    } else if let Some(stand_in) = StandIn::of(bytes) {
        Err(ImageError::Unsupported { path: path.to_owned(), problem: stand_in.to_string() })
    } else {
        Err(ImageError::UnknownFormat { path: path.to_owned(), expected: KNOWN })
    }
}

#[cfg(test)]
mod tests;
