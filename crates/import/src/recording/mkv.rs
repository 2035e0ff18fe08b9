//! Matroska of the Azure Kinect's and the Femto's recorders: frames, by the `matroska-demuxer` crate.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};

use matroska_demuxer::{DemuxError, Frame, MatroskaFile};

use super::bounded::Bounded;
use super::packet::{End, Layout, Packet, Source, StreamInfo, Visitor};
use crate::error::ImportError;

const KIND: &str = "Matroska file";

pub(super) fn visit(
    source: Source<'_>,
    wanted: &dyn Fn(&StreamInfo) -> bool,
    visitor: &mut Visitor<'_>,
) -> Result<End, ImportError> {
    let file = File::open(source.file).map_err(|error| source.unreadable(error))?;
    let length = file.metadata().map_err(|error| source.unreadable(error))?.len();
    let reader = Bounded::new(BufReader::new(file), length);
    let fault = |error| match error {
        // Its text would be that of the error's cause, mostly "None".
        DemuxError::IoError(error) => source.damaged(KIND, error),
        error => source.damaged(KIND, error),
    };
    let mut file = guarded(source, || MatroskaFile::open(reader))?.map_err(fault)?;
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
    let mut has_frames = false;
    loop {
        match guarded(source, || file.next_frame(&mut frame))? {
            Ok(true) => has_frames = true,
            Ok(false) => return Ok(End::Whole),
            // A recording that was interrupted, or a copy that is not complete.
            Err(DemuxError::ElementSizeExceedsStream { .. }) if has_frames => return Ok(End::Cut),
            Err(DemuxError::IoError(error)) if has_frames && error.kind() == ErrorKind::UnexpectedEof => {
                return Ok(End::Cut);
            }
            Err(error) => return Err(fault(error)),
        }
        let Some((stream, size)) = streams.get(&frame.track) else { continue };
        let time_ns = frame.timestamp.saturating_mul(scale);
        let packet = Packet { stream, layout: Layout::Track(*size), time_ns, data: Cow::Borrowed(&frame.data) };
        if visitor(packet)?.is_break() {
            return Ok(End::Stopped);
        }
    }
}

/// Calls the demuxer and makes its panics errors. Its sums of broken numbers wrap, and panic in a build that checks overflow in
/// dependencies; it is generic over the reader, so that its arithmetic is compiled with ours, and nothing before it can tell
/// which numbers it will add.
fn guarded<T>(source: Source<'_>, read: impl FnOnce() -> T) -> Result<T, ImportError> {
    catch_unwind(AssertUnwindSafe(read)).map_err(|_| source.damaged(KIND, "its numbers are out of range"))
}
