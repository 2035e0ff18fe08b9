//! JSON files that carry their format and version.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::error::FileError;
use super::finite::not_finite;
use super::json::{parse_json, read_bytes, write_json, write_json_compact};

/// A field whose value contradicts its meaning; [`Fault::in_file`] makes it an error.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Path of the field, such as `frames[3].rotation`.
    pub field: String,
    /// The predicate of the message, such as `must be greater than 0`.
    pub problem: String,
}

impl Fault {
    pub fn new(field: impl Into<String>, problem: impl Into<String>) -> Self {
        Fault { field: field.into(), problem: problem.into() }
    }

    pub fn in_file(self, path: &Path) -> FileError {
        FileError::Invalid { path: path.to_owned(), field: self.field, problem: self.problem }
    }
}

/// The contents of a JSON file that identifies itself by the fields `format` and `version`.
pub(crate) trait Versioned: Serialize + DeserializeOwned {
    const FORMAT: &'static str;
    const VERSION: u32;
    /// The oldest version that is still read.
    const OLDEST: u32 = Self::VERSION;
    /// Whether the file has no white space, as large ones do.
    const COMPACT: bool = false;

    /// The version that is written: the oldest that has all that these contents have.
    fn version(&self) -> u32 {
        Self::VERSION
    }

    /// Checks what the types do not express: sizes, ranges, uniqueness of names.
    fn check(&self) -> Result<(), Fault>;
}

#[derive(Deserialize)]
struct Header {
    format: Option<serde_json::Value>,
    version: Option<u64>,
}

#[derive(Serialize)]
struct Envelope<'a, T> {
    format: &'static str,
    version: u32,
    #[serde(flatten)]
    body: &'a T,
}

/// Reads such a file and checks format, version and contents.
pub(crate) fn read_versioned<T: Versioned>(path: &Path) -> Result<T, FileError> {
    parse_versioned(path, &read_bytes(path)?)
}

/// As [`read_versioned`], for contents in memory; `path` only names their source in errors.
pub(crate) fn parse_versioned<T: Versioned>(path: &Path, text: &[u8]) -> Result<T, FileError> {
    let header: Header = parse_json(path, text)?;
    if header.format.as_ref().and_then(|format| format.as_str()) != Some(T::FORMAT) {
        let format = header.format.map_or("missing".into(), |format| format.to_string());
        return Err(FileError::Format { path: path.to_owned(), expected: T::FORMAT, found: format });
    }
    match header.version {
        Some(version) if (u64::from(T::OLDEST)..=u64::from(T::VERSION)).contains(&version) => {}
        Some(found) => {
            let (oldest, expected) = (T::OLDEST, T::VERSION);
            return Err(FileError::Version { path: path.to_owned(), oldest, expected, found });
        }
        None => return Err(Fault::new("version", "is missing").in_file(path)),
    }
    let body: T = parse_json(path, text)?;
    body.check().map_err(|fault| fault.in_file(path))?;
    Ok(body)
}

/// Checks the contents and writes them with format and version, atomically.
pub(crate) fn write_versioned<T: Versioned>(path: &Path, body: &T) -> Result<(), FileError> {
    // First, since NaN would pass the checks of ranges.
    if let Some(field) = not_finite(body) {
        return Err(FileError::NotFinite { path: path.to_owned(), field });
    }
    body.check().map_err(|fault| fault.in_file(path))?;
    let envelope = Envelope { format: T::FORMAT, version: body.version(), body };
    if T::COMPACT { write_json_compact(path, &envelope) } else { write_json(path, &envelope) }
}
