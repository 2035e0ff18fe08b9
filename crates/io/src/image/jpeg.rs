//! JPEG, by the `zune-jpeg` crate.

use std::panic::{AssertUnwindSafe, catch_unwind};
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

/// The orientation in a JPEG's EXIF data, 1 to 8; `None` where it has none.
pub(crate) fn orientation(bytes: &[u8]) -> Option<u16> {
    if !is_jpeg(bytes) {
        return None;
    }
    let mut at_segment = 2;
    loop {
        let [0xff, marker, high, low] = *bytes.get(at_segment..at_segment + 4)? else { return None };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let segment = bytes.get(at_segment + 4..at_segment + 2 + length)?;
        match (marker, segment.strip_prefix(b"Exif\0\0")) {
            (0xe1, Some(tiff)) => return orientation_of_tiff(tiff),
            // The image begins.
            (0xda, _) => return None,
            _ => at_segment += 2 + length,
        }
    }
}

/// The orientation in the first directory of TIFF data.
fn orientation_of_tiff(tiff: &[u8]) -> Option<u16> {
    const ORIENTATION: u16 = 0x0112;
    let is_little = tiff.starts_with(b"II");
    let short = |place: usize| {
        let pair: [u8; 2] = tiff.get(place..place.checked_add(2)?)?.try_into().ok()?;
        Some(if is_little { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) })
    };
    let long = |place: usize| {
        let [first, second] = [short(place)?, short(place + 2)?].map(usize::from);
        Some(if is_little { second << 16 | first } else { first << 16 | second })
    };
    let directory = long(4)?;
    let entries = usize::from(short(directory)?);
    let places = (0..entries).map(|i| directory + 2 + 12 * i);
    let entry = places.take_while(|place| *place < tiff.len()).find(|place| short(*place) == Some(ORIENTATION))?;
    short(entry + 8).filter(|orientation| (1..=8).contains(orientation))
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
    if has_unknown_sampling(bytes) {
        return Err(damaged("its brightness is sampled more coarsely than its colour, which is not supported".into()));
    }
    // The decoder counts on lengths that belong together, which those of a damaged file need not.
    let values = catch_unwind(AssertUnwindSafe(|| decoder.decode()))
        .map_err(|_| damaged("its parts do not fit together".into()))?
        .map_err(|error| damaged(error.to_string()))?;
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

/// Whether the components are sampled as no camera does it, and the decoder would panic: the first one more coarsely than
/// another, or half as often as the others from row to row in a scan of its own (ITU-T T.81, B.2.2 and B.2.3).
fn has_unknown_sampling(bytes: &[u8]) -> bool {
    let mut factors: Vec<[u8; 2]> = Vec::new();
    let mut unread = bytes.get(2..).unwrap_or_default();
    while let [fill, mark, segment @ ..] = unread {
        // As the decoder does, whatever lies between the segments is passed over.
        if *fill != 0xff || matches!(mark, 0x00 | 0x01 | 0xd0..=0xd9 | 0xff) {
            unread = &unread[1..];
            continue;
        }
        let length = segment.first_chunk().map_or(0, |length| usize::from(u16::from_be_bytes(*length)));
        match mark {
            0xc0..=0xcf if ![0xc4, 0xc8, 0xcc].contains(mark) => {
                let components = segment.get(8..).unwrap_or_default().chunks_exact(3);
                let count = usize::from(*segment.get(7).unwrap_or(&0));
                factors = components.take(count).map(|component| [component[1] >> 4, component[1] & 15]).collect();
            }
            0xda => {
                let Some(first) = factors.first() else { return false };
                let is_alone = usize::from(*segment.get(2).unwrap_or(&0)) < factors.len();
                return is_alone && *first == [1, 2] || factors.iter().any(|f| f[0] > first[0] || f[1] > first[1]);
            }
            _ => {}
        }
        unread = segment.get(length..).unwrap_or_default();
    }
    false
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
