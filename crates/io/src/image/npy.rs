//! NumPy's NPY, by the `npyz` crate, and NPZ, an archive of such files.

use std::io::{Cursor, Read};
use std::path::Path;

use half::f16;
use npyz::{DType, Deserialize, NpyFile, Order, WriterBuilder};
use zip::ZipArchive;

use super::decoded::{Decoded, Values};
use super::depth_frame::{DepthFrame, DepthValues};
use super::error::ImageError;
use super::pixels::{MAX_PIXELS, pixels};

pub(crate) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

pub(crate) fn is_npz(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

fn damaged(path: &Path, message: impl std::fmt::Display) -> ImageError {
    ImageError::Damaged { path: path.to_owned(), format: "NPY", message: message.to_string() }
}

/// Refuses headers that are longer or deeper than those NumPy writes of a plain array: others could claim memory, or exhaust the
/// parser.
fn check_header(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let number = |range: std::ops::Range<usize>| {
        bytes.get(range).map(|b| b.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b)))
    };
    let (start, length) = match bytes.get(6) {
        Some(1) => (10, number(8..10)),
        _ => (12, number(8..12)),
    };
    let text = length.filter(|length| *length <= 4096).and_then(|length| bytes.get(start..start + length));
    let text = text.ok_or_else(|| damaged(path, "its header is cut off or implausibly long"))?;
    if text.windows(3).any(|kind| kind == b"'|O") {
        let problem = "this NPY has Python objects instead of numbers, as arrays of unequal shapes become: save one array of numbers per frame";
        return Err(ImageError::Unsupported { path: path.to_owned(), problem: problem.into() });
    }
    let brackets = text.iter().filter(|byte| b"([{".contains(byte)).count();
    let numbers: Vec<&[u8]> = text.split(|byte| !byte.is_ascii_digit()).filter(|digits| !digits.is_empty()).collect();
    // One number is in the type, at most three are of the shape.
    if brackets > 3 || numbers.len() > 4 || numbers.iter().any(|digits| digits.len() > 5) {
        let problem = "this NPY is no image: save an array of numbers with the shape (height, width) or (height, width, channels)";
        return Err(ImageError::Unsupported { path: path.to_owned(), problem: problem.into() });
    }
    Ok(())
}

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Decoded, ImageError> {
    check_header(path, bytes)?;
    let file = NpyFile::new(Cursor::new(bytes)).map_err(|error| damaged(path, error))?;
    let unsupported = |problem: String| ImageError::Unsupported { path: path.to_owned(), problem };
    let shape: Vec<usize> = file.shape().iter().map(|n| *n as usize).collect();
    let (height, width, channels) = match shape[..] {
        [height, width] => (height, width, 1),
        [height, width, channels @ 1..=4] => (height, width, channels),
        _ => {
            return Err(unsupported(format!(
                "this NPY has the shape {shape:?}: save (height, width) or (height, width, channels)"
            )));
        }
    };
    let count = pixels(path, width, height)?;
    let DType::Plain(kind) = file.dtype() else {
        return Err(unsupported("this NPY has records: save an array of numbers".into()));
    };
    let kind = kind.to_string();
    let size: usize = kind.get(2..).and_then(|size| size.parse().ok()).unwrap_or(8);
    let needed = count * channels * size;
    if bytes.len() < needed {
        return Err(damaged(path, format_args!("it has {} bytes, of {needed}", bytes.len())));
    }
    let order = file.order();
    let wide = |values: Result<Vec<f64>, ImageError>, largest: f64| values.map(|values| Values::Wide(values, largest));
    let values = match kind.get(1..).unwrap_or_default() {
        "u1" => Values::U8(read(path, file)?),
        "u2" => Values::U16(read(path, file)?),
        "f2" => Values::F32(read::<f16>(path, file)?.into_iter().map(f16::to_f32).collect()),
        "f4" => Values::F32(read(path, file)?),
        "f8" => Values::F32(read::<f64>(path, file)?.into_iter().map(|v| v as f32).collect()),
        "i1" => wide(read::<i8>(path, file).map(|v| v.into_iter().map(f64::from).collect()), i8::MAX.into())?,
        "i2" => wide(read::<i16>(path, file).map(|v| v.into_iter().map(f64::from).collect()), i16::MAX.into())?,
        "i4" => wide(read::<i32>(path, file).map(|v| v.into_iter().map(f64::from).collect()), i32::MAX.into())?,
        "u4" => wide(read::<u32>(path, file).map(|v| v.into_iter().map(f64::from).collect()), u32::MAX.into())?,
        "i8" => wide(read::<i64>(path, file).map(|v| v.into_iter().map(|v| v as f64).collect()), i64::MAX as f64)?,
        "u8" => wide(read::<u64>(path, file).map(|v| v.into_iter().map(|v| v as f64).collect()), u64::MAX as f64)?,
        _ => {
            return Err(unsupported(format!(
                "this NPY has values of the type {kind}: save whole or floating-point numbers"
            )));
        }
    };
    let values = if order == Order::Fortran { by_rows(values, height, width, channels) } else { values };
    Ok(Decoded { width, height, channels, values, format: "NPY" })
}

fn read<T: Deserialize>(path: &Path, file: NpyFile<Cursor<&[u8]>>) -> Result<Vec<T>, ImageError> {
    file.into_vec().map_err(|error| damaged(path, error))
}

/// Values in the order of columns (Fortran's), row by row.
fn by_rows(values: Values, height: usize, width: usize, channels: usize) -> Values {
    fn turned<T: Copy>(values: Vec<T>, height: usize, width: usize, channels: usize) -> Vec<T> {
        let value = |i: usize| {
            let (pixel, channel) = (i / channels, i % channels);
            values[pixel / width + height * (pixel % width + width * channel)]
        };
        (0..values.len()).map(value).collect()
    }
    match values {
        Values::U8(values) => Values::U8(turned(values, height, width, channels)),
        Values::U16(values) => Values::U16(turned(values, height, width, channels)),
        Values::F32(values) => Values::F32(turned(values, height, width, channels)),
        Values::Wide(values, largest) => Values::Wide(turned(values, height, width, channels), largest),
    }
}

/// The purpose that an archive is read for, which tells the array that is meant where it has several.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Wanted {
    /// An image.
    Image,
    /// A depth image.
    Depth,
}

impl Wanted {
    fn names(self) -> &'static [&'static str] {
        match self {
            Self::Image => &["image", "ir", "infrared", "amplitude", "gray", "grey", "color", "colour", "rgb"],
            Self::Depth => &["depth", "depth_mm", "z", "disparity"],
        }
    }
}

pub(crate) fn decode_archive(path: &Path, bytes: &[u8], wanted: Wanted) -> Result<Decoded, ImageError> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| damaged(path, error))?;
    let names = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned()));
    let arrays: Vec<String> = names.filter_map(|name| Some(name.strip_suffix(".npy")?.to_owned())).collect();
    let name = match arrays.as_slice() {
        [one] => Some(one.clone()),
        several => {
            let mut named = several.iter().filter(|array| wanted.names().contains(&array.to_lowercase().as_str()));
            // Of two that could be meant none is.
            named.next().filter(|_| named.next().is_none()).cloned()
        }
    };
    let Some(name) = name else {
        let problem = format!(
            "this NPZ has the arrays {}, and which one is meant is not clear: save one alone, or exactly one under a name such as \"{}\"",
            arrays.join(", "),
            wanted.names()[0]
        );
        return Err(ImageError::Unsupported { path: path.to_owned(), problem });
    };
    let name = name + ".npy";
    let member = archive.by_name(&name).map_err(|error| damaged(path, error))?;
    // Reading stops where the largest image ends, whatever the archive claims.
    let limit = 8 * MAX_PIXELS as u64;
    let mut array = Vec::new();
    member.take(limit).read_to_end(&mut array).map_err(|error| damaged(path, error))?;
    decode(path, &array)
}

/// The bytes of an NPY of 16-bit or 32-bit floating-point values with the shape (height, width).
pub(crate) fn encode(frame: &DepthFrame) -> Result<Vec<u8>, String> {
    fn write<T: npyz::AutoSerialize + Copy>(shape: [usize; 2], values: &[T]) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let shape = shape.map(|n| n as u64);
        let mut writer = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd()?;
        writer.extend(values.iter().copied())?;
        writer.finish()?;
        Ok(bytes)
    }
    let shape = [frame.height, frame.width];
    match &frame.values {
        DepthValues::Steps(values) => write(shape, values),
        DepthValues::Float(values) => write(shape, values),
    }
    .map_err(|error| error.to_string())
}
