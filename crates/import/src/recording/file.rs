//! A recording of any kind: a file, or the files of a folder.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::attachment::attachment;
use super::compressed::{self, is_zstd};
use super::folder::Folder;
use super::packet::{End, Packet, Source, StreamInfo, Visitor, damaged};
use super::{bag, db3, mcap_file, mkv};
use crate::error::ImportError;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Mcap,
    Db3,
    Bag,
    Mkv,
}

impl Kind {
    /// The kind of a file by its first bytes.
    fn of(head: &[u8]) -> Option<Self> {
        match head {
            head if head.starts_with(b"\x89MCAP0\r\n") => Some(Kind::Mcap),
            head if head.starts_with(b"SQLite format 3\0") => Some(Kind::Db3),
            head if head.starts_with(b"#ROSBAG V2.0\n") => Some(Kind::Bag),
            head if head.starts_with(b"\x1a\x45\xdf\xa3") => Some(Kind::Mkv),
            _ => None,
        }
    }
}

/// A file of a recording.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    kind: Kind,
    /// The contents of a file that is compressed as a whole.
    contents: Option<NamedTempFile>,
}

impl Part {
    fn source(&self) -> Source<'_> {
        Source { file: self.contents.as_ref().map_or(&self.path, |file| file.path()), name: &self.path }
    }
}

/// A recording. Its files are recognised by their first bytes.
#[derive(Debug)]
pub(crate) struct Recording {
    pub path: PathBuf,
    parts: Vec<Part>,
    /// A folder of image files.
    folder: Option<Folder>,
    /// Files that end within a record.
    cut: RefCell<BTreeSet<PathBuf>>,
}

impl Recording {
    /// Opens a file, or a folder with the files of a ROS 2 bag, in the order of the numbers in their names. The table of contents
    /// beside them, `metadata.yaml`, is not needed: it is written last, and an interrupted recording has none.
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let mut recording =
            Recording { path: path.to_owned(), parts: Vec::new(), folder: None, cut: RefCell::default() };
        let unreadable = |error| ImportError::Read { path: path.to_owned(), error };
        if !path.is_dir() {
            let first = File::open(path).and_then(head).map_err(unreadable)?;
            if first.starts_with(b"PK\x03\x04") {
                return Err(ImportError::Archive { path: path.to_owned() });
            }
            let unknown = || ImportError::UnknownKind { path: path.to_owned() };
            let part = recording.part(path)?.ok_or_else(unknown)?;
            recording.parts.push(part);
            return Ok(recording);
        }
        recording.folder = Folder::open(path)?;
        if recording.folder.is_some() {
            return Ok(recording);
        }
        let entries = std::fs::read_dir(path).and_then(Iterator::collect::<io::Result<Vec<_>>>).map_err(unreadable)?;
        let mut files: Vec<PathBuf> =
            entries.iter().map(std::fs::DirEntry::path).filter(|file| file.is_file()).collect();
        files.sort_by_cached_key(|file| numbered(&file.file_name().unwrap_or_default().to_string_lossy()));
        let present = files.clone();
        files.retain(|file| {
            file.extension().is_none_or(|e| e != "zstd") || is_missing(&present, &file.with_extension(""))
        });
        for file in files {
            let part = recording.part(&file)?;
            recording.parts.extend(part);
        }
        if recording.parts.is_empty() {
            return Err(ImportError::UnknownKind { path: path.to_owned() });
        }
        Ok(recording)
    }

    /// The file if it is one of a recording.
    fn part(&self, path: &Path) -> Result<Option<Part>, ImportError> {
        let unreadable = |error| ImportError::Read { path: path.to_owned(), error };
        let first = head(File::open(path).map_err(unreadable)?).map_err(unreadable)?;
        if !is_zstd(&first) {
            return Ok(Kind::of(&first).map(|kind| Part { path: path.to_owned(), kind, contents: None }));
        }
        let fault = |error: io::Error| damaged(path, "compressed file", error);
        let (contents, is_whole) = compressed::unpacked(File::open(path).map_err(unreadable)?).map_err(fault)?;
        if !is_whole {
            self.cut.borrow_mut().insert(path.to_owned());
        }
        let kind = Kind::of(&head(File::open(contents.path()).map_err(fault)?).map_err(fault)?);
        Ok(kind.map(|kind| Part { path: path.to_owned(), kind, contents: Some(contents) }))
    }

    /// The folder of image files that it is.
    pub fn folder(&self) -> Option<&Folder> {
        self.folder.as_ref()
    }

    /// The file of this name that a Matroska file carries; `None` where there is none.
    pub fn attachment(&self, name: &str) -> Result<Option<Vec<u8>>, ImportError> {
        let Some(part) = self.parts.iter().find(|part| part.kind == Kind::Mkv) else { return Ok(None) };
        attachment(part.source(), name)
    }

    /// The files of which only the beginning was there to be read, as far as the recording was visited.
    pub fn cut(&self) -> Vec<PathBuf> {
        self.cut.borrow().iter().cloned().collect()
    }

    /// Reads the messages of the streams that `wanted` accepts, up to the end of what is complete.
    pub fn visit(&self, wanted: &dyn Fn(&StreamInfo) -> bool, visitor: &mut Visitor<'_>) -> Result<(), ImportError> {
        // Messages of ROS are never of zstd's four first bytes: ROS 2 compresses some recordings message by message.
        let mut unpacking = |packet: Packet<'_>| match is_zstd(&packet.data) {
            false => visitor(packet),
            true => {
                let data = compressed::message(&packet.data).map_err(|error| ImportError::Message {
                    path: self.path.clone(),
                    stream: packet.stream.name.clone(),
                    problem: format!("a message cannot be decompressed: {error}"),
                })?;
                visitor(Packet { data: Cow::Owned(data), ..packet })
            }
        };
        if let Some(folder) = &self.folder {
            return folder.visit(wanted, &mut unpacking).map(drop);
        }
        for part in &self.parts {
            let source = part.source();
            let end = match part.kind {
                Kind::Mcap => mcap_file::visit(source, wanted, &mut unpacking),
                Kind::Db3 => db3::visit(source, wanted, &mut unpacking),
                Kind::Bag => bag::visit(source, wanted, &mut unpacking),
                Kind::Mkv => mkv::visit(source, wanted, &mut unpacking),
            }?;
            match end {
                End::Whole => {}
                End::Stopped => break,
                End::Cut => {
                    self.cut.borrow_mut().insert(part.path.clone());
                }
            }
        }
        Ok(())
    }
}

/// Whether a compressed file is of a recording and has no decompressed copy in its folder: `ros2 bag play` writes one there.
fn is_missing(present: &[PathBuf], file: &PathBuf) -> bool {
    file.extension().is_some_and(|e| e == "db3" || e == "mcap") && !present.contains(file)
}

/// The first bytes of a file.
fn head(file: File) -> io::Result<Vec<u8>> {
    let mut head = Vec::with_capacity(16);
    file.take(16).read_to_end(&mut head)?;
    Ok(head)
}

/// A name in parts by which names sort as their numbers do: `bag_2` before `bag_10`.
fn numbered(name: &str) -> Vec<(String, u64)> {
    let mut parts = Vec::new();
    let mut unread = name;
    while !unread.is_empty() {
        let text = unread.find(|c: char| c.is_ascii_digit()).unwrap_or(unread.len());
        let digits = unread[text..].find(|c: char| !c.is_ascii_digit()).map_or(unread.len(), |end| text + end);
        parts.push((unread[..text].to_owned(), unread[text..digits].parse().unwrap_or(0)));
        unread = &unread[digits..];
    }
    parts
}
