//! The text of `dataset.toml`.

use std::fs;
use std::io;
use std::path::Path;

use super::error::DatasetError;

/// The text of a `dataset.toml`.
pub(crate) fn read_text(path: &Path) -> Result<String, DatasetError> {
    fs::read_to_string(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => DatasetError::NoDatasetFile { path: path.to_owned() },
        _ => DatasetError::Read { path: path.to_owned(), error },
    })
}
