//! Errors of files.

use std::io;
use std::path::PathBuf;

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
    #[error("{path}: cannot write the file: {error}")]
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
}

fn versions(oldest: u32, newest: u32) -> String {
    if oldest == newest { format!("version {newest}") } else { format!("versions {oldest} to {newest}") }
}
