//! Matroska of the Azure Kinect's and the Femto's recorders: frames, by the `matroska-demuxer` crate.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use matroska_demuxer::{DemuxError, Frame, MatroskaFile};

use super::bounded::Bounded;
use super::packet::{Layout, Packet, StreamInfo, Visitor, damaged};
use crate::error::ImportError;

pub(super) fn visit(
    path: &Path,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<(), ImportError> {
    let unreadable = |error| ImportError::Read { path: path.to_owned(), error };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    let reader = Bounded::new(BufReader::new(file), length);
    let fault = |error| match error {
        // Its text would be that of the error's cause, mostly "None".
        DemuxError::IoError(error) => damaged(path, "Matroska file", error),
        error => damaged(path, "Matroska file", error),
    };
    let mut file = guarded(path, || MatroskaFile::open(reader))?.map_err(fault)?;
    let scale = file.info().timestamp_scale().get();
    let mut streams: BTreeMap<u64, (StreamInfo, [usize; 2])> = BTreeMap::new();
    for track in file.tracks() {
        let Some(video) = track.video() else { continue };
        let number = track.track_number().get();
        let name = track.name().map_or_else(|| format!("track {number}"), str::to_owned);
        // A BITMAPINFOHEADER, whose biCompression at byte 16 is the code of the pixels' format.
        let code = track.codec_private().filter(|_| track.codec_id() == "V_MS/VFW/FOURCC").and_then(|p| p.get(16..20));
        let kind = code.map_or_else(|| track.codec_id().to_owned(), |code| String::from_utf8_lossy(code).into_owned());
        let stream = StreamInfo { name, kind };
        if wanted(&stream) {
            let size = [video.pixel_width().get(), video.pixel_height().get()].map(|side| side as usize);
            streams.insert(number, (stream, size));
        }
    }
    let mut frame = Frame::default();
    while guarded(path, || file.next_frame(&mut frame))?.map_err(fault)? {
        let Some((stream, size)) = streams.get(&frame.track) else { continue };
        let time_ns = frame.timestamp.saturating_mul(scale);
        let packet = Packet { stream, layout: Layout::Track(*size), time_ns, data: Cow::Borrowed(&frame.data) };
        if visitor(packet)?.is_break() {
            break;
        }
    }
    Ok(())
}

/// Calls the demuxer and makes its panics errors. Its sums of broken numbers wrap, and panic in a build that checks overflow in
/// dependencies; it is generic over the reader, so that its arithmetic is compiled with ours, and nothing before it can tell
/// which numbers it will add.
fn guarded<T>(path: &Path, read: impl FnOnce() -> T) -> Result<T, ImportError> {
    catch_unwind(AssertUnwindSafe(read)).map_err(|_| damaged(path, "Matroska file", "its numbers are out of range"))
}
