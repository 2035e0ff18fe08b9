//! Messages that hold images and intrinsics.

use std::path::Path;

use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::fields::Fields;
use crate::info_message;
use crate::picture::{Encoding, Picture};
use crate::recording::{DEPTH_FILES, IMAGE_FILES, Layout, Packet, StreamInfo};

/// The contents of a message.
pub(crate) enum Content<'a> {
    /// An image, and its time of capture in ns.
    Picture(u64, Picture<'a>),
    /// Intrinsics.
    Info(CameraInfo),
}

/// Whether messages of this stream are images.
pub(crate) fn has_images(stream: &StreamInfo) -> bool {
    const KINDS: [&str; 7] =
        ["sensor_msgs/Image", "sensor_msgs/CompressedImage", "b16g", "MJPG", "V_MJPEG", IMAGE_FILES, DEPTH_FILES];
    KINDS.contains(&stream.kind.as_str())
}

/// Whether messages of this stream are intrinsics.
pub(crate) fn has_info(stream: &StreamInfo) -> bool {
    stream.kind == "sensor_msgs/CameraInfo"
}

/// The frame of coordinates of a message with a header; empty where there is none.
pub(crate) fn frame_of(packet: &Packet<'_>) -> String {
    let frame = || Some(Fields::new(packet.layout, &packet.data)?.header_with_frame()?.1);
    frame().unwrap_or_default()
}

/// Reads a message of a stream of images or intrinsics.
pub(crate) fn content<'a>(path: &Path, packet: &'a Packet<'_>) -> Result<Content<'a>, ImportError> {
    let problem =
        |problem: String| ImportError::Message { path: path.to_owned(), stream: packet.stream.name.clone(), problem };
    let cut = || problem("a message is cut off or not of its type".into());
    let data: &[u8] = &packet.data;
    // Width and height are in the file.
    let file = Picture { width: 0, height: 0, step: 0, encoding: Encoding::File, data };
    if packet.layout == Layout::File {
        return Ok(Content::Picture(packet.time_ns, file));
    }
    if let Layout::Pixels([width, height], encoding) = packet.layout {
        let step = encoding.row_bytes(width).unwrap_or(0);
        return Ok(Content::Picture(packet.time_ns, Picture { width, height, step, encoding, data }));
    }
    if let Layout::Track(size) = packet.layout {
        if packet.stream.kind != "b16g" {
            return Ok(Content::Picture(packet.time_ns, file));
        }
        let [width, height] = size;
        let needed = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(2));
        if needed.is_none_or(|needed| needed == 0 || needed > data.len()) {
            return Err(problem(format!("an image of {width}×{height} px has {} bytes", data.len())));
        }
        let picture = Picture { width, height, step: 2 * width, encoding: Encoding::Mono16Big, data };
        return Ok(Content::Picture(packet.time_ns, picture));
    }
    let mut fields = Fields::new(packet.layout, &packet.data).ok_or_else(cut)?;
    if has_info(packet.stream) {
        return info_message::read(fields).map(Content::Info).map_err(problem);
    }
    let stamp = fields.header().ok_or_else(cut)?;
    // Drivers without a clock stamp nothing.
    let time_ns = if stamp == 0 { packet.time_ns } else { stamp };
    if packet.stream.kind == "sensor_msgs/CompressedImage" {
        let format = fields.string().ok_or_else(cut)?;
        let data = fields.blob().ok_or_else(cut)?;
        let (encoding, data) = Encoding::compressed(&format, data).map_err(problem)?;
        return Ok(Content::Picture(time_ns, Picture { width: 0, height: 0, step: 0, encoding, data }));
    }
    let mut image = || {
        let (height, width) = (fields.u32()? as usize, fields.u32()? as usize);
        let (encoding, is_big) = (fields.string()?, fields.u8()? != 0);
        let step = fields.u32()? as usize;
        Some((width, height, encoding, is_big, step, fields.blob()?))
    };
    let (width, height, name, is_big, step, data) = image().ok_or_else(cut)?;
    let encoding = Encoding::of(&name, is_big).map_err(problem)?;
    let row = encoding.row_bytes(width);
    let needed = row.and_then(|row| height.checked_sub(1)?.checked_mul(step)?.checked_add(row));
    if width == 0 || row.is_none_or(|row| step < row) || needed.is_none_or(|needed| needed > data.len()) {
        return Err(problem(format!("an image of {width}×{height} px has {} bytes in rows of {step}", data.len())));
    }
    Ok(Content::Picture(time_ns, Picture { width, height, step, encoding, data }))
}
