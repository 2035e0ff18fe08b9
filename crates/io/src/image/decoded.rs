//! Pixels as a file holds them, and what they become: grey values, colours, or depth.

use std::path::Path;

use super::depth_frame::{DepthFrame, DepthValues};
use super::error::ImageError;
use super::pixels::luma;
use super::raster::{GrayImage, RgbImage};

/// Samples of a file in their type, `channels` of each pixel together.
#[derive(Debug)]
pub(crate) enum Values {
    U8(Vec<u8>),
    U16(Vec<u16>),
    /// Floating-point numbers; those of 16 bits exactly, those of 64 bits rounded.
    F32(Vec<f32>),
    /// Whole numbers of other types, and the largest of the type.
    Wide(Vec<f64>, f64),
}

impl Values {
    pub fn len(&self) -> usize {
        match self {
            Values::U8(values) => values.len(),
            Values::U16(values) => values.len(),
            Values::F32(values) => values.len(),
            Values::Wide(values, _) => values.len(),
        }
    }

    /// Type of the values, for messages.
    fn name(&self) -> &'static str {
        match self {
            Values::U8(_) => "8-bit",
            Values::U16(_) => "16-bit",
            Values::F32(_) => "floating-point",
            Values::Wide(..) => "whole-number",
        }
    }
}

/// The pixels of a file, row by row.
#[derive(Debug)]
pub(crate) struct Decoded {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    pub values: Values,
    /// The format's name.
    pub format: &'static str,
}

/// Depth where the file has one channel of at least 16 bits.
pub(crate) fn depth(path: &Path, decoded: Decoded) -> Result<DepthFrame, ImageError> {
    let Decoded { width, height, channels, values, format } = decoded;
    if channels != 1 || matches!(values, Values::U8(_)) {
        let kind = values.name();
        let description = if channels == 1 {
            format!("{kind} grey {format}")
        } else {
            format!("{kind} {format} of {channels} channels")
        };
        return Err(ImageError::NotDepth { path: path.to_owned(), found: description });
    }
    let values = match values {
        Values::U8(_) => DepthValues::Steps(Vec::new()),
        Values::U16(values) => DepthValues::Steps(values),
        Values::F32(values) => DepthValues::Float(values),
        Values::Wide(values, largest) => {
            let value = |v: f64| if v > 0.0 && v < largest { v } else { 0.0 };
            // Beyond 16 bits a single-precision number holds 24.
            if values.iter().all(|v| value(*v) < f64::from(u16::MAX)) {
                DepthValues::Steps(values.into_iter().map(|v| value(v) as u16).collect())
            } else {
                DepthValues::Float(values.into_iter().map(|v| value(v) as f32).collect())
            }
        }
    };
    Ok(DepthFrame { width, height, values })
}

/// Grey values of 8 or 16 bits. Numbers of other types are rounded and limited to 16 bits; floating-point images within 0 … 1 are
/// scaled by 65535 first.
pub(crate) fn gray(path: &Path, decoded: Decoded) -> Result<GrayImage, ImageError> {
    let Decoded { width, height, channels, values, format } = decoded;
    let (values, bits) = sixteen(values);
    let data = match channels {
        1 => values,
        2 => values.chunks_exact(2).map(|pixel| pixel[0]).collect(),
        3 | 4 => values.chunks_exact(channels).map(|p| luma([p[0], p[1], p[2]])).collect(),
        _ => return Err(too_many(path, channels, format)),
    };
    Ok(GrayImage { width, height, data, bits })
}

/// Colours of 8 bits; grey becomes three equal channels, of 16 bits the upper 8 are kept.
pub(crate) fn rgb(path: &Path, decoded: Decoded) -> Result<RgbImage, ImageError> {
    let Decoded { width, height, channels, values, format } = decoded;
    let (values, bits) = sixteen(values);
    let byte = |value: u16| if bits == 16 { (value >> 8) as u8 } else { value as u8 };
    let pixel = |p: &[u16]| if channels < 3 { [byte(p[0]); 3] } else { [byte(p[0]), byte(p[1]), byte(p[2])] };
    if channels > 4 {
        return Err(too_many(path, channels, format));
    }
    Ok(RgbImage { width, height, data: values.chunks_exact(channels).map(pixel).collect() })
}

fn too_many(path: &Path, channels: usize, format: &str) -> ImageError {
    let problem = format!("this {format} has {channels} channels: save one (grey) or three (colour)");
    ImageError::Unsupported { path: path.to_owned(), problem }
}

fn sixteen(values: Values) -> (Vec<u16>, u8) {
    let limited = |v: f64| v.round().clamp(0.0, 65535.0) as u16;
    match values {
        Values::U8(values) => (values.into_iter().map(u16::from).collect(), 8),
        Values::U16(values) => (values, 16),
        Values::Wide(values, _) => (values.into_iter().map(limited).collect(), 16),
        Values::F32(values) => {
            let greatest = values.iter().copied().filter(|v| v.is_finite()).fold(0.0_f32, f32::max);
            let scale = if greatest <= 1.0 { 65535.0 } else { 1.0 };
            // The cast makes 0 of NaN.
            (values.into_iter().map(|v| limited(f64::from(v) * scale)).collect(), 16)
        }
    }
}
