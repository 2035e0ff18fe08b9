//! An `.rrd` file: a stream of chunks, each the content of one entity at one frame or at all frames.
//!
//! The chunks are encoded straight into the file, without rerun's logging threads: errors are returned where they happen, and
//! there is no timeline of when the program ran.

use std::fmt::Display;
use std::io::{self, Write};

use re_chunk::{Chunk, RowId, TimePoint, Timeline};
use re_log_encoding::{Encoder, EncodingOptions};
use re_log_types::{LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreKind, StoreSource};
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::RecordingInfo;

/// Name of the timeline.
pub(super) const TIMELINE: &str = "frame";

/// The content of one entity, at one frame or, without one, at all.
pub(super) fn chunk(entity: &str, frame: Option<usize>, shown: &dyn AsComponents) -> io::Result<Chunk> {
    let time = match frame {
        Some(frame) => TimePoint::default().with(Timeline::new_sequence(TIMELINE), frame as i64),
        None => TimePoint::default(),
    };
    Chunk::builder(entity).with_archetype_auto_row(time, shown).build().map_err(broken)
}

/// A recording that is being written.
pub(super) struct Recording<'a> {
    encoder: Encoder<&'a mut dyn Write>,
    store: StoreId,
}

impl<'a> Recording<'a> {
    /// Begins a recording with a name.
    pub(super) fn new(file: &'a mut dyn Write, name: &str) -> io::Result<Self> {
        let store = StoreId::random(StoreKind::Recording, "depthcal");
        let info = StoreInfo::new(store.clone(), StoreSource::Other("depthcal".to_owned()));
        let version = info.store_version.ok_or_else(|| io::Error::other("rerun does not tell its version"))?;
        let mut encoder = Encoder::new_eager(version, EncodingOptions::PROTOBUF_COMPRESSED, file).map_err(broken)?;
        encoder.append(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: RowId::new().as_tuid(), info })).map_err(broken)?;
        let mut recording = Self { encoder, store };
        let info = RecordingInfo::new().with_name(name);
        let properties = re_chunk::EntityPath::properties();
        let chunk = Chunk::builder(properties).with_archetype_auto_row(TimePoint::default(), &info).build();
        recording.append(&[chunk.map_err(broken)?])?;
        Ok(recording)
    }

    /// Appends chunks.
    pub(super) fn append(&mut self, chunks: &[Chunk]) -> io::Result<()> {
        for chunk in chunks {
            let message = LogMsg::ArrowMsg(self.store.clone(), chunk.to_arrow_msg().map_err(broken)?);
            self.encoder.append(&message).map_err(broken)?;
        }
        Ok(())
    }

    /// Ends the recording.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.encoder.finish().map_err(broken)
    }
}

/// An error of rerun's as one of the file.
fn broken(error: impl Display) -> io::Error {
    io::Error::other(error.to_string())
}
