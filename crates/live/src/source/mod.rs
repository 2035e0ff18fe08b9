//! Sources of frames.

mod folder;
mod stream;

use std::io::{BufReader, Read};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use crate::error::LiveError;
use crate::inbox::{Inbox, SourceEnd};
pub use stream::read_frame;

/// The origin of frames.
pub enum Source {
    /// A folder that fills, with `image/` and `depth/`, with images alone, or with a `dataset.toml`. Every file is looked at.
    Folder {
        /// The folder.
        path: PathBuf,
        /// Millimetres per step of the depth images, where no `dataset.toml` says it.
        unit_mm: Option<f64>,
        /// Whether a running camera fills it, so that frames in which the board moves are not kept.
        is_video: bool,
    },
    /// Raw frames, see `docs/live.md`. Frames that come while another is searched replace each other: the newest counts.
    Stream(Box<dyn Read + Send>),
}

/// Reads a source in a thread of its own until it ends or the inbox is closed.
///
/// # Errors
/// [`LiveError::NoFolder`], [`LiveError::NoUnit`].
pub fn spawn(source: Source, inbox: Arc<Inbox>) -> Result<(), LiveError> {
    match source {
        Source::Folder { path, unit_mm, is_video } => {
            let mut folder = folder::Folder::open(path, unit_mm, is_video)?;
            thread::spawn(move || {
                let end = folder.watch(&inbox);
                inbox.end(end);
            });
        }
        Source::Stream(reader) => {
            thread::spawn(move || {
                let mut reader = BufReader::with_capacity(1 << 20, reader);
                let end = pump(&mut reader, &inbox);
                inbox.end(end);
            });
        }
    }
    Ok(())
}

/// Reads frames until the stream ends.
fn pump(reader: &mut BufReader<Box<dyn Read + Send>>, inbox: &Inbox) -> SourceEnd {
    for number in 1.. {
        match read_frame(reader, number) {
            Ok(Some(arrival)) => {
                if !inbox.replace_frame(arrival) {
                    break;
                }
            }
            Ok(None) => break,
            Err(error) => return SourceEnd { problem: Some(error.to_string()) },
        }
    }
    SourceEnd { problem: None }
}
