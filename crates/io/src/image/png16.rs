//! PNG, by the `png` crate.

use std::io::{self, Cursor};
use std::path::Path;

use png::{BitDepth, ColorType, Transformations};

use super::error::ImageError;
use super::pixels::{luma, pixels};
use super::raster::{DepthImage, GrayImage, RgbImage};
use crate::file::{FileError, write_atomically};

pub(crate) fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

struct Samples {
    width: usize,
    height: usize,
    channels: usize,
    bits: u8,
    values: Vec<u16>,
}

fn damaged(path: &Path, error: impl std::fmt::Display) -> ImageError {
    ImageError::Damaged { path: path.to_owned(), format: "PNG", message: error.to_string() }
}

/// Decodes with the given expansion, provided that `accept` takes the file's colour type and bit depth.
fn samples(
    path: &Path,
    bytes: &[u8],
    expansion: Transformations,
    accept: impl FnOnce(ColorType, BitDepth) -> Result<(), ImageError>,
) -> Result<Samples, ImageError> {
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: usize::MAX });
    decoder.set_transformations(expansion);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().map_err(|error| damaged(path, error))?;
    let (width, height) = (header.width as usize, header.height as usize);
    let pixels = pixels(path, width, height)?;
    let (color, depth) = (header.color_type, header.bit_depth);
    accept(color, depth)?;
    // Deflate compresses at most 1032 to 1: a file too short for its size is refused before memory is allocated.
    if pixels / 8 * color.samples() * depth as usize > 1032 * bytes.len() {
        return Err(damaged(path, format_args!("it is too short for {width}×{height} pixels")));
    }

    let mut reader = decoder.read_info().map_err(|error| damaged(path, error))?;
    let size = reader.output_buffer_size().ok_or_else(|| damaged(path, "its size exceeds the memory"))?;
    let mut buffer = vec![0; size];
    let info = reader.next_frame(&mut buffer).map_err(|error| damaged(path, error))?;
    // Read on to the end marker: a file cut after its last pixel is incomplete too.
    reader.finish().map_err(|error| damaged(path, error))?;
    let (bits, values) = match info.bit_depth {
        BitDepth::Sixteen => (16, buffer.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()),
        _ => (8, buffer.into_iter().map(u16::from).collect()),
    };
    Ok(Samples { width, height, channels: info.color_type.samples(), bits, values })
}

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<GrayImage, ImageError> {
    let Samples { width, height, channels, bits, values } =
        samples(path, bytes, Transformations::EXPAND, |_, _| Ok(()))?;
    let data = match channels {
        1 => values,
        2 => values.chunks_exact(2).map(|pixel| pixel[0]).collect(),
        _ => values.chunks_exact(channels).map(|pixel| luma([pixel[0], pixel[1], pixel[2]])).collect(),
    };
    Ok(GrayImage { width, height, data, bits })
}

pub(crate) fn decode_rgb(path: &Path, bytes: &[u8]) -> Result<RgbImage, ImageError> {
    let Samples { width, height, channels, bits, values } =
        samples(path, bytes, Transformations::EXPAND, |_, _| Ok(()))?;
    let byte = |value: u16| if bits == 16 { (value >> 8) as u8 } else { value as u8 };
    let pixel = |p: &[u16]| if channels < 3 { [byte(p[0]); 3] } else { [byte(p[0]), byte(p[1]), byte(p[2])] };
    Ok(RgbImage { width, height, data: values.chunks_exact(channels).map(pixel).collect() })
}

pub(crate) fn decode_depth(path: &Path, bytes: &[u8]) -> Result<DepthImage, ImageError> {
    let accept = |color: ColorType, depth: BitDepth| {
        if (color, depth) == (ColorType::Grayscale, BitDepth::Sixteen) {
            return Ok(());
        }
        let color = match color {
            ColorType::Grayscale => "grey",
            ColorType::GrayscaleAlpha => "grey with alpha",
            ColorType::Rgb => "RGB",
            ColorType::Rgba => "RGBA",
            ColorType::Indexed => "palette",
        };
        Err(ImageError::NotDepth { path: path.to_owned(), found: format!("{}-bit {color} PNG", depth as u8) })
    };
    let Samples { width, height, values, .. } = samples(path, bytes, Transformations::IDENTITY, accept)?;
    Ok(DepthImage { width, height, data: values })
}

pub(crate) fn write(path: &Path, [width, height]: [usize; 2], data: &[u16], bits: u8) -> Result<(), FileError> {
    let invalid = |problem: String| FileError::Invalid { path: path.to_owned(), field: "data".into(), problem };
    if width.checked_mul(height) != Some(data.len()) || data.is_empty() {
        return Err(invalid(format!("has {} values for {width}×{height} pixels", data.len())));
    }
    let (depth, bytes): (_, Vec<u8>) = match bits {
        16 => (BitDepth::Sixteen, data.iter().flat_map(|value| value.to_be_bytes()).collect()),
        8 => {
            let bytes = data.iter().map(|value| u8::try_from(*value)).collect::<Result<_, _>>();
            (BitDepth::Eight, bytes.map_err(|_| invalid("has values above 255 in an 8-bit image".into()))?)
        }
        _ => return Err(invalid(format!("has {bits} bits per value, expected 8 or 16"))),
    };
    write_bytes(path, [width, height], &bytes, (ColorType::Grayscale, depth))
}

/// Writes red, green and blue of every pixel.
pub(crate) fn write_rgb(path: &Path, [width, height]: [usize; 2], data: &[u8]) -> Result<(), FileError> {
    if width.checked_mul(height).and_then(|n| n.checked_mul(3)) != Some(data.len()) || data.is_empty() {
        let problem = format!("has {} values for {width}×{height} pixels of three", data.len());
        return Err(FileError::Invalid { path: path.to_owned(), field: "data".into(), problem });
    }
    write_bytes(path, [width, height], data, (ColorType::Rgb, BitDepth::Eight))
}

fn write_bytes(
    path: &Path,
    [width, height]: [usize; 2],
    bytes: &[u8],
    (color, depth): (ColorType, BitDepth),
) -> Result<(), FileError> {
    let (Ok(columns), Ok(rows)) = (u32::try_from(width), u32::try_from(height)) else {
        let problem = format!("has {width}×{height} pixels, too many for a PNG");
        return Err(FileError::Invalid { path: path.to_owned(), field: "data".into(), problem });
    };
    write_atomically(path, |writer| {
        let mut encoder = png::Encoder::new(writer, columns, rows);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().map_err(io::Error::from)?;
        writer.write_image_data(bytes).map_err(io::Error::from)?;
        writer.finish().map_err(io::Error::from)
    })
}
