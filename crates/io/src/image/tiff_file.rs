//! TIFF, by the `tiff` crate: the first page, grey or colour, whole or floating-point numbers.

use std::io::Cursor;
use std::path::Path;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::{Gray16, Gray32Float};

use super::decoded::{Decoded, Values};
use super::depth_frame::{DepthFrame, DepthValues};
use super::error::ImageError;
use super::pixels::{MAX_PIXELS, fits, pixels};

pub(crate) fn is_tiff(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(*magic))
}

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Decoded, ImageError> {
    let damaged = |error: tiff::TiffError| ImageError::Damaged {
        path: path.to_owned(),
        format: "TIFF",
        message: error.to_string(),
    };
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 16 * MAX_PIXELS;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    let (width, height) = (width as usize, height as usize);
    let count = pixels(path, width, height)?;
    let color = decoder.colortype().map_err(damaged)?;
    let channels = match color {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        ColorType::Multiband { num_samples, .. } => usize::from(num_samples),
        other => {
            let problem = format!("this TIFF has colours of the type {other:?}: save it as grey or RGB");
            return Err(ImageError::Unsupported { path: path.to_owned(), problem });
        }
    };
    // Codes of LZW grow to 12 bits, each for at most 4096 bytes.
    fits(path, "TIFF", count.saturating_mul(channels * usize::from(color.bit_depth()).div_ceil(8)), 4096, bytes.len())?;
    let wide = |values: Vec<f64>, largest: f64| Values::Wide(values, largest);
    let values = match decoder.read_image().map_err(damaged)? {
        DecodingResult::U8(values) => Values::U8(values),
        DecodingResult::U16(values) => Values::U16(values),
        DecodingResult::F16(values) => Values::F32(values.into_iter().map(|v| v.to_f32()).collect()),
        DecodingResult::F32(values) => Values::F32(values),
        DecodingResult::F64(values) => Values::F32(values.into_iter().map(|v| v as f32).collect()),
        DecodingResult::I8(values) => wide(values.into_iter().map(f64::from).collect(), i8::MAX.into()),
        DecodingResult::I16(values) => wide(values.into_iter().map(f64::from).collect(), i16::MAX.into()),
        DecodingResult::I32(values) => wide(values.into_iter().map(f64::from).collect(), i32::MAX.into()),
        DecodingResult::U32(values) => wide(values.into_iter().map(f64::from).collect(), u32::MAX.into()),
        DecodingResult::I64(values) => wide(values.into_iter().map(|v| v as f64).collect(), i64::MAX as f64),
        DecodingResult::U64(values) => wide(values.into_iter().map(|v| v as f64).collect(), u64::MAX as f64),
    };
    if values.len() < count * channels {
        let message = format!("it has {} values for {width}×{height} pixels of {channels} channels", values.len());
        return Err(ImageError::Damaged { path: path.to_owned(), format: "TIFF", message });
    }
    Ok(Decoded { width, height, channels, values, format: "TIFF" })
}

/// The bytes of a grey TIFF of 16-bit or 32-bit floating-point values.
pub(crate) fn encode(frame: &DepthFrame) -> Result<Vec<u8>, String> {
    let (Ok(width), Ok(height)) = (u32::try_from(frame.width), u32::try_from(frame.height)) else {
        return Err("is too large for a TIFF".into());
    };
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).map_err(|error| error.to_string())?;
    let written = match &frame.values {
        DepthValues::Steps(values) => encoder.write_image::<Gray16>(width, height, values),
        DepthValues::Float(values) => encoder.write_image::<Gray32Float>(width, height, values),
    };
    written.map_err(|error| error.to_string())?;
    Ok(bytes.into_inner())
}
