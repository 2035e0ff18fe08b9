//! Raw frames on a stream: for each a line of JSON, then the bytes of the image, then those of the depth image.

use std::io::{BufRead, Read};

use depthcal_io::{DepthFrame, DepthValues, FrameMetadata, GrayImage};
use serde::Deserialize;

use crate::arrival::Arrival;
use crate::error::LiveError;

/// Most bytes of a line of JSON.
const MOST_HEADER: u64 = 4096;
/// Most pixels of an image: 64 million are twice as many as any depth camera has, and bound what a broken header allocates.
const MOST_PIXELS: usize = 1 << 26;

/// Types of the image's values; of several bytes the lowest is first.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ImageFormat {
    Gray8,
    Gray16,
    Rgb8,
    Bgr8,
}

/// Types of the depth's values; of several bytes the lowest is first.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum DepthFormat {
    U16,
    F32,
}

/// The line of JSON before the bytes of a frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    width: usize,
    height: usize,
    format: ImageFormat,
    depth: Option<DepthFormat>,
    unit_mm: Option<f64>,
    timestamp_s: Option<f64>,
    temperature_c: Option<f64>,
}

/// Reads the next frame; `None` at the end of the stream. `number`, from 1, is for messages.
///
/// # Errors
/// [`LiveError::Stream`]: a header that is no such JSON, sizes beyond all cameras, or a stream that ends within a frame.
pub fn read_frame(reader: &mut impl BufRead, number: u64) -> Result<Option<Arrival>, LiveError> {
    let wrong = |problem: String| LiveError::Stream { number, problem };
    let broken = |error: std::io::Error| wrong(format!("cannot be read: {error}"));
    let mut line = Vec::new();
    reader.by_ref().take(MOST_HEADER).read_until(b'\n', &mut line).map_err(broken)?;
    if line.is_empty() {
        return Ok(None);
    }
    if line.last() != Some(&b'\n') {
        return Err(wrong(match line.len() as u64 {
            MOST_HEADER => format!("its header is longer than {MOST_HEADER} bytes: begin with a line of JSON"),
            _ => "the stream ends within its header".to_owned(),
        }));
    }
    let header: Header = serde_json::from_slice(&line).map_err(|error| {
        wrong(format!(
            "its header is not what docs/live.md describes ({error}): write a line such as \
             {{\"width\":640,\"height\":480,\"format\":\"gray8\",\"depth\":\"u16\",\"unit_mm\":1.0}}"
        ))
    })?;
    let Header { width, height, format, depth, unit_mm, timestamp_s, temperature_c } = header;
    let pixels = width.checked_mul(height).filter(|pixels| (1..=MOST_PIXELS).contains(pixels));
    let pixels = pixels.ok_or_else(|| wrong(format!("{width} × {height} px is no size of an image")))?;
    if depth.is_some() && !unit_mm.is_some_and(|unit| unit.is_finite() && unit > 0.0) {
        return Err(wrong("it has depth, but no unit_mm above 0: give the millimetres per step".to_owned()));
    }
    if [timestamp_s, temperature_c].into_iter().flatten().any(|value| !value.is_finite()) {
        return Err(wrong("its time or temperature is no finite number".to_owned()));
    }
    let mut bytes = |per_pixel: usize, of: &str| {
        let wanted = pixels * per_pixel;
        let mut bytes = Vec::new();
        let read = reader.by_ref().take(wanted as u64).read_to_end(&mut bytes).map_err(broken)?;
        match read == wanted {
            true => Ok(bytes),
            false => Err(wrong(format!("the stream ends within its {of}, after {read} of {wanted} bytes"))),
        }
    };
    let channels = match format {
        ImageFormat::Gray8 => 1,
        ImageFormat::Gray16 => 2,
        ImageFormat::Rgb8 | ImageFormat::Bgr8 => 3,
    };
    let data = grey(format, &bytes(channels, "image")?);
    let bits = if format == ImageFormat::Gray16 { 16 } else { 8 };
    let values = match depth {
        None => None,
        Some(DepthFormat::U16) => Some(DepthValues::Steps(words(&bytes(2, "depth")?))),
        Some(DepthFormat::F32) => {
            let floats = |b: &[u8; 4]| f32::from_le_bytes(*b);
            Some(DepthValues::Float(bytes(4, "depth")?.as_chunks().0.iter().map(floats).collect()))
        }
    };
    Ok(Some(Arrival {
        name: format!("frame {number}"),
        image: GrayImage { width, height, data, bits },
        depth: values.map(|values| DepthFrame { width, height, values }),
        unit_mm: unit_mm.filter(|_| depth.is_some()),
        metadata: FrameMetadata { timestamp_s, temperature_c, ..FrameMetadata::default() },
        is_video: true,
    }))
}

fn words(bytes: &[u8]) -> Vec<u16> {
    bytes.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect()
}

/// Grey values; of colours luma, as files of colours are read.
fn grey(format: ImageFormat, bytes: &[u8]) -> Vec<u16> {
    let luma = |[r, g, b]: [u8; 3]| (0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)).round() as u16;
    match format {
        ImageFormat::Gray8 => bytes.iter().map(|v| u16::from(*v)).collect(),
        ImageFormat::Gray16 => words(bytes),
        ImageFormat::Rgb8 => bytes.as_chunks().0.iter().map(|c| luma(*c)).collect(),
        ImageFormat::Bgr8 => bytes.as_chunks().0.iter().map(|[b, g, r]| luma([*r, *g, *b])).collect(),
    }
}
