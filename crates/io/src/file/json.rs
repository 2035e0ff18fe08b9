//! JSON files: read with the path of the faulty field, written atomically and only with finite numbers.
//!
//! Numbers keep every bit: they are written in the shortest form that reads back as the same `f64`.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::finite::not_finite;
use crate::{FileError, write_atomically};

/// Reads a JSON file.
///
/// # Errors
/// [`FileError::Read`], or [`FileError::Json`] with the path of the field that is missing or wrong.
pub fn read_json<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T, FileError> {
    let path = path.as_ref();
    parse_json(path, &read(path)?)
}

/// Writes a JSON file, indented, atomically (see [`write_atomically`]).
///
/// # Errors
/// [`FileError::NotFinite`] names the first NaN or infinity; nothing is written then. [`FileError::Write`].
pub fn write_json<T: Serialize + ?Sized>(path: impl AsRef<Path>, value: &T) -> Result<(), FileError> {
    write_checked(path.as_ref(), value, |writer| {
        serde_json::to_writer_pretty(&mut *writer, value)?;
        writer.write_all(b"\n")
    })
}

/// Writes a JSON file without white space, for large files; else as [`write_json`].
///
/// # Errors
/// As [`write_json`].
pub fn write_json_compact<T: Serialize + ?Sized>(path: impl AsRef<Path>, value: &T) -> Result<(), FileError> {
    write_checked(path.as_ref(), value, |writer| {
        serde_json::to_writer(&mut *writer, value)?;
        writer.write_all(b"\n")
    })
}

fn write_checked<T, F>(path: &Path, value: &T, fill: F) -> Result<(), FileError>
where
    T: Serialize + ?Sized,
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    if let Some(field) = not_finite(value) {
        return Err(FileError::NotFinite { path: path.to_owned(), field });
    }
    write_atomically(path, fill)
}

fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    fs::read(path).map_err(|error| FileError::Read { path: path.to_owned(), error })
}

/// Parses the contents of `path`, which is only named in errors.
pub(crate) fn parse_json<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<T, FileError> {
    let mut reader = serde_json::Deserializer::from_slice(text);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| FileError::Json {
        path: path.to_owned(),
        field: error.path().to_string(),
        message: error.inner().to_string(),
    })?;
    reader.end().map_err(|error| FileError::Json {
        path: path.to_owned(),
        field: ".".into(),
        message: format!("there is text after the end: {error}"),
    })?;
    Ok(value)
}

/// What a field contradicts; [`Fault::in_file`] makes it an error.
#[derive(Debug)]
pub(crate) struct Fault {
    pub field: String,
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

/// A file that says what it is in its fields `format` and `version`.
pub(crate) trait Versioned: Serialize + DeserializeOwned {
    const FORMAT: &'static str;
    const VERSION: u32;

    /// Checks what the types cannot: sizes, ranges, names.
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

pub(crate) fn read_versioned<T: Versioned>(path: &Path) -> Result<T, FileError> {
    parse_versioned(path, &read(path)?)
}

/// As [`read_versioned`], for contents that are in memory.
pub(crate) fn parse_versioned<T: Versioned>(path: &Path, text: &[u8]) -> Result<T, FileError> {
    let header: Header = parse_json(path, text)?;
    if header.format.as_ref().and_then(|format| format.as_str()) != Some(T::FORMAT) {
        let found = header.format.map_or("missing".into(), |format| format.to_string());
        return Err(FileError::Format { path: path.to_owned(), expected: T::FORMAT, found });
    }
    match header.version {
        Some(version) if version == u64::from(T::VERSION) => {}
        Some(found) => return Err(FileError::Version { path: path.to_owned(), expected: T::VERSION, found }),
        None => return Err(Fault::new("version", "is missing").in_file(path)),
    }
    let body: T = parse_json(path, text)?;
    body.check().map_err(|fault| fault.in_file(path))?;
    Ok(body)
}

pub(crate) fn write_versioned<T: Versioned>(path: &Path, body: &T, compact: bool) -> Result<(), FileError> {
    // Before the checks of meaning, which NaN would slip through.
    if let Some(field) = not_finite(body) {
        return Err(FileError::NotFinite { path: path.to_owned(), field });
    }
    body.check().map_err(|fault| fault.in_file(path))?;
    let envelope = Envelope { format: T::FORMAT, version: T::VERSION, body };
    if compact { write_json_compact(path, &envelope) } else { write_json(path, &envelope) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn nothing_is_written_for_nan() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("numbers.json");
        let error = write_json(&path, &vec![1.0, f64::NAN]).unwrap_err();
        assert!(matches!(error, FileError::NotFinite { ref field, .. } if field == "[1]"), "{error}");
        assert!(!path.exists());
    }

    #[test]
    fn errors_name_file_and_field() {
        let path = Path::new("numbers.json");
        let error = parse_json::<Vec<(f64, f64)>>(path, b"[[1, 2], [3, \"x\"]]").unwrap_err().to_string();
        assert!(error.contains("numbers.json") && error.contains("[1][1]") && error.contains("line 1"), "{error}");
        assert!(parse_json::<Vec<f64>>(path, b"[1] 2").is_err());
        assert!(parse_json::<Vec<f64>>(path, b"[1e999]").is_err());
        assert!(read_json::<Vec<f64>>("no/such/file.json").unwrap_err().to_string().contains("no/such/file.json"));
    }

    proptest! {
        #[test]
        fn numbers_keep_every_bit(bits in any::<u64>()) {
            let number = f64::from_bits(bits);
            prop_assume!(number.is_finite());
            let text = serde_json::to_vec(&number).unwrap();
            let back: f64 = parse_json(Path::new("x"), &text).unwrap();
            prop_assert_eq!(back.to_bits(), bits);
        }
    }
}
