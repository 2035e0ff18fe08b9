//! OpenEXR, by the `exr` crate: one channel of depth, or grey or colour.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, FlatSamples, Image, ReadChannels, ReadLayers, Vec2, WritableImage, f16, read,
};

use super::decoded::{Decoded, Values};
use super::depth_frame::{DepthFrame, DepthValues};
use super::error::ImageError;
use super::pixels::{fits, pixels};

pub(crate) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x76\x2f\x31\x01")
}

/// Names of a single channel of depth or grey, in the order in which they are looked for.
const SINGLE: &[&str] = &["Z", "depth.Z", "Depth.Z", "depth", "Depth", "Y", "V"];

pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Decoded, ImageError> {
    let damaged = |error: exr::error::Error| ImageError::Damaged {
        path: path.to_owned(),
        format: "EXR",
        message: error.to_string(),
    };
    // The header first, so that it cannot claim all memory.
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.width(), header.layer_size.height());
        let count = pixels(path, width, height)?;
        // Blocks of 32 rows of a constant image shrink to some tens of bytes.
        fits(path, "EXR", count.saturating_mul(header.channels.bytes_per_pixel), 1 << 14, bytes.len())?;
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let layer = image.layer_data;
    let Vec2(width, height) = layer.size;
    let count = pixels(path, width, height)?;
    let channels = layer.channel_data.list;
    let named = |name: &str| channels.iter().find(|channel| channel.name.eq(name));
    let chosen: Vec<&AnyChannel<FlatSamples>> = match channels.as_slice() {
        [one] => vec![one],
        _ => match (SINGLE.iter().find_map(|name| named(name)), named("R"), named("G"), named("B")) {
            (Some(one), ..) => vec![one],
            (None, Some(r), Some(g), Some(b)) => vec![r, g, b],
            _ => {
                let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
                let problem = format!(
                    "this EXR has the channels {}: save a single one, or Z or Y for depth and grey, or R, G, B",
                    names.join(", ")
                );
                return Err(ImageError::Unsupported { path: path.to_owned(), problem });
            }
        },
    };
    if chosen.iter().any(|channel| channel.sample_data.len() != count) {
        let problem = "this EXR has channels that are subsampled: save every pixel".to_owned();
        return Err(ImageError::Unsupported { path: path.to_owned(), problem });
    }
    let values = match chosen.as_slice() {
        [AnyChannel { sample_data: FlatSamples::U32(values), .. }] => {
            Values::Wide(values.iter().copied().map(f64::from).collect(), u32::MAX.into())
        }
        channels => {
            let floats: Vec<Vec<f32>> = channels.iter().map(|channel| floats(&channel.sample_data)).collect();
            Values::F32((0..count).flat_map(|i| floats.iter().map(move |values| values[i])).collect())
        }
    };
    Ok(Decoded { width, height, channels: chosen.len(), values, format: "EXR" })
}

fn floats(samples: &FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F16(values) => values.iter().copied().map(f16::to_f32).collect(),
        FlatSamples::F32(values) => values.clone(),
        FlatSamples::U32(values) => values.iter().map(|v| *v as f32).collect(),
    }
}

/// The bytes of an EXR with one channel Z of 32-bit floating-point values, compressed without loss.
pub(crate) fn encode(frame: &DepthFrame) -> Result<Vec<u8>, String> {
    let values: Vec<f32> = match &frame.values {
        DepthValues::Steps(values) => values.iter().copied().map(f32::from).collect(),
        DepthValues::Float(values) => values.clone(),
    };
    let channel = AnyChannel::new("Z", FlatSamples::F32(values));
    let layer = exr::prelude::Layer::new(
        (frame.width, frame.height),
        exr::prelude::LayerAttributes::named("depth"),
        exr::prelude::Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(vec![channel].into()),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes.into_inner())
}
