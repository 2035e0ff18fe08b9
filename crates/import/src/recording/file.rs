//! A recording of any kind.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::packet::{StreamInfo, Visitor};
use super::{bag, db3, mcap_file, mkv};
use crate::error::ImportError;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Mcap,
    Db3,
    Bag,
    Mkv,
}

/// A recording, recognised by its first bytes.
#[derive(Debug)]
pub(crate) struct Recording {
    pub path: PathBuf,
    kind: Kind,
}

impl Recording {
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let mut head = [0; 16];
        let mut file = File::open(path).map_err(|error| ImportError::Read { path: path.to_owned(), error })?;
        let mut filled = 0;
        while filled < head.len() {
            match file.read(&mut head[filled..]).map_err(|error| ImportError::Read { path: path.to_owned(), error })? {
                0 => break,
                n => filled += n,
            }
        }
        let kind = match &head {
            head if head.starts_with(b"\x89MCAP0\r\n") => Kind::Mcap,
            head if head.starts_with(b"SQLite format 3\0") => Kind::Db3,
            head if head.starts_with(b"#ROSBAG V2.0\n") => Kind::Bag,
            head if head.starts_with(b"\x1a\x45\xdf\xa3") => Kind::Mkv,
            _ => return Err(ImportError::UnknownKind { path: path.to_owned() }),
        };
        Ok(Recording { path: path.to_owned(), kind })
    }

    pub fn is_matroska(&self) -> bool {
        self.kind == Kind::Mkv
    }

    /// Reads the messages of the streams that `wanted` accepts.
    pub fn visit(&self, wanted: &dyn Fn(&StreamInfo) -> bool, visitor: &mut Visitor<'_>) -> Result<(), ImportError> {
        match self.kind {
            Kind::Mcap => mcap_file::visit(&self.path, wanted, visitor),
            Kind::Db3 => db3::visit(&self.path, wanted, visitor),
            Kind::Bag => bag::visit(&self.path, wanted, visitor),
            Kind::Mkv => mkv::visit(&self.path, wanted, visitor),
        }
    }
}
