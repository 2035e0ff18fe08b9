//! JPEG, by the `zune-jpeg` crate.

use std::path::Path;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::error::ImageError;
use super::pixels::{fits, luma, pixels};
use super::raster::{GrayImage, RgbImage};

pub(crate) fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xff\xd8\xff")
}

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<GrayImage, ImageError> {
    // Detection needs the luma, which the file holds; converting to RGB and back would only add rounding.
    let ([width, height], data) = decode_as(
        path,
        bytes,
        ColorSpace::Luma,
        |values| values.into_iter().map(u16::from).collect(),
        |values| values.chunks_exact(3).map(|p| luma([p[0], p[1], p[2]].map(u16::from))).collect(),
    )?;
    Ok(GrayImage { width, height, data, bits: 8 })
}

pub(crate) fn decode_rgb(path: &Path, bytes: &[u8]) -> Result<RgbImage, ImageError> {
    let ([width, height], data) = decode_as(
        path,
        bytes,
        ColorSpace::RGB,
        |values| values.into_iter().map(|v| [v; 3]).collect(),
        |values| values.as_chunks().0.to_vec(),
    )?;
    Ok(RgbImage { width, height, data })
}

/// Width and height, and the pixels decoded to `colours`. The decoder may give one channel or three, whichever was
/// requested.
fn decode_as<P>(
    path: &Path,
    bytes: &[u8],
    colours: ColorSpace,
    from_one: impl Fn(Vec<u8>) -> Vec<P>,
    from_three: impl Fn(Vec<u8>) -> Vec<P>,
) -> Result<([usize; 2], Vec<P>), ImageError> {
    let damaged = |message: String| ImageError::Damaged { path: path.to_owned(), format: "JPEG", message };
    if is_cut_off(bytes) {
        return Err(damaged("the end is missing".into()));
    }
    let options = DecoderOptions::default().jpeg_set_out_colorspace(colours);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| damaged(error.to_string()))?;
    let (width, height) = decoder.dimensions().ok_or_else(|| damaged("it has no size".into()))?;
    let count = pixels(path, width, height)?;
    // A block of 64 pixels takes a bit at least, in a progressive image without contrast.
    fits(path, "JPEG", count, 512, bytes.len())?;
    let values = decoder.decode().map_err(|error| damaged(error.to_string()))?;
    let data = match values.len() / count {
        1 => from_one(values),
        3 => from_three(values),
        channels => return Err(damaged(format!("it has {channels} channels, which is not supported"))),
    };
    if data.len() != count {
        return Err(damaged("it has fewer pixels than its header says".into()));
    }
    Ok(([width, height], data))
}

/// Whether the last scan has no end marker. The decoder would silently fill the missing part with grey.
fn is_cut_off(bytes: &[u8]) -> bool {
    let last = |mark: u8| bytes.windows(2).rposition(|pair| pair == [0xff, mark]);
    match (last(0xda), last(0xd9)) {
        (_, None) => true,
        (Some(scan), Some(end)) => end < scan,
        (None, Some(_)) => false,
    }
}
