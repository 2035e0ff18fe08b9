//! Errors of files.

use std::io;
use std::path::{Path, PathBuf};

/// Why a file could not be read or written, or why its contents are refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file cannot be opened or read.
    #[error("{path}: cannot read the file: {error}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The file, or its folder, cannot be written.
    #[error("{path}: cannot write here: {error}{}", remedy(error))]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The text is not the JSON that is expected here.
    #[error("{path}: field `{field}`: {message}")]
    Json {
        /// The file.
        path: PathBuf,
        /// Path of the field, for example `camera.pieces[2].parameters[0].value`.
        field: String,
        /// The parser's message, with line and column.
        message: String,
    },
    /// A file of another kind.
    #[error("{path}: field `format` is {found}, expected \"{expected}\": give a file that depthcal wrote as such")]
    Format {
        /// The file.
        path: PathBuf,
        /// Name of the format that is expected.
        expected: &'static str,
        /// The file's `format`, as JSON, or `missing`.
        found: String,
    },
    /// A version of the format that this program does not know.
    #[error(
        "{path}: field `version` is {found}, this program reads {}: use a program of the file's version, or write the file anew",
        versions(*oldest, *expected)
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Oldest version that this program reads.
        oldest: u32,
        /// Newest version that this program reads.
        expected: u32,
        /// Version of the file.
        found: u64,
    },
    /// A NaN or infinity in a result that was to be written; JSON has neither.
    #[error("{path}: field `{field}` is not a finite number, so nothing was written: the result is not usable")]
    NotFinite {
        /// The file that was to be written.
        path: PathBuf,
        /// Path of the field.
        field: String,
    },
    /// A field whose value contradicts its meaning.
    #[error("{path}: field `{field}` {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Path of the field.
        field: String,
        /// The fault, and what is expected.
        problem: String,
    },
    /// The folder that an evaluation is to be written into has the calibration of another camera or fit.
    #[error(
        "{path}: holds a calibration other than {evaluated}, whose evaluation and report would be replaced: choose another folder"
    )]
    OtherCalibration {
        /// The folder.
        path: PathBuf,
        /// Name of the calibration, or of the camera file, that was evaluated.
        evaluated: String,
    },
}

impl FileError {
    /// The error, of the file of the same name in `to` instead of `from`.
    pub(super) fn moved(mut self, from: &Path, to: &Path) -> Self {
        let (FileError::Read { path, .. }
        | FileError::Write { path, .. }
        | FileError::Json { path, .. }
        | FileError::Format { path, .. }
        | FileError::Version { path, .. }
        | FileError::NotFinite { path, .. }
        | FileError::Invalid { path, .. }
        | FileError::OtherCalibration { path, .. }) = &mut self;
        if let Ok(name) = path.strip_prefix(from) {
            *path = to.join(name);
        }
        self
    }
}

/// Remedy for an error of writing.
fn remedy(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull => {
            "; free some space, or give a folder on another disk. What was there before is unchanged"
        }
        io::ErrorKind::QuotaExceeded => {
            "; free some of your quota, or give a folder elsewhere. What was there before is unchanged"
        }
        io::ErrorKind::FileTooLarge => {
            "; the system limits the size of files (ulimit -f): raise the limit. What was there before is unchanged"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "; give a folder that you may write, or change its permissions"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "; a file is in the place of a folder: give another folder, or move the file away"
        }
        io::ErrorKind::IsADirectory => {
            "; a folder is in the place of the file: give another name, or move the folder away"
        }
        _ => "",
    }
}

fn versions(oldest: u32, newest: u32) -> String {
    if oldest == newest { format!("version {newest}") } else { format!("versions {oldest} to {newest}") }
}
