//! JSON files. Errors of reading name the faulty field by its path; files are written atomically, and only when all
//! numbers are finite.
//!
//! Numbers keep every bit: they are written in the shortest form that reads back as the same `f64`.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::FileError;
use super::finite::not_finite;
use super::write::write_atomically;

/// Reads a JSON file.
///
/// # Errors
/// [`FileError::Read`], or [`FileError::Json`] with the path of the field that is missing or wrong.
pub fn read_json<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T, FileError> {
    let path = path.as_ref();
    parse_json(path, &read_bytes(path)?)
}

/// Whether a file is JSON with a `format` of depthcal's.
pub fn is_of_depthcal(path: &Path) -> bool {
    let json = fs::read(path).ok().and_then(|text| serde_json::from_slice::<serde_json::Value>(&text).ok());
    json.is_some_and(|json| json["format"].as_str().is_some_and(|format| format.starts_with("depthcal")))
}

/// Writes a JSON file, indented, atomically (see [`write_atomically`]).
///
/// # Errors
/// [`FileError::NotFinite`] names the first NaN or infinity, and nothing is written. [`FileError::Write`].
pub fn write_json<T: Serialize + ?Sized>(path: impl AsRef<Path>, value: &T) -> Result<(), FileError> {
    write_checked(path.as_ref(), value, |writer| {
        serde_json::to_writer_pretty(&mut *writer, value)?;
        writer.write_all(b"\n")
    })
}

/// Writes a JSON file without white space, for large files; otherwise as [`write_json`].
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

/// The contents of a file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    fs::read(path).map_err(|error| FileError::Read { path: path.to_owned(), error })
}

/// Parses JSON; `path` only names its source in errors.
pub(super) fn parse_json<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<T, FileError> {
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
