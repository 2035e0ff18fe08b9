//! The source files of one crate, by path below the crate's folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::StructureError;

/// Texts of all `.rs` files below `src/`, keyed by their path relative to the crate (`src/lib.rs`).
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: BTreeMap<PathBuf, String>,
}

impl Sources {
    /// Reads `src/` of the crate in `folder`.
    ///
    /// # Errors
    /// [`StructureError::Read`] if a folder or file cannot be read.
    pub fn read(folder: &Path) -> Result<Self, StructureError> {
        let mut sources = Self::default();
        sources.read_folder(folder, Path::new("src"))?;
        Ok(sources)
    }

    /// Sources given as pairs of path and text.
    pub fn from_texts<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        Self { files: files.into_iter().map(|(path, text)| (path.into(), text.into())).collect() }
    }

    /// The text of a file, if it exists.
    pub fn text(&self, path: &Path) -> Option<&str> {
        self.files.get(path).map(String::as_str)
    }

    fn read_folder(&mut self, root: &Path, folder: &Path) -> Result<(), StructureError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| StructureError::Read { path, source }
        };
        let absolute = root.join(folder);
        for entry in std::fs::read_dir(&absolute).map_err(failed(&absolute))? {
            let entry = entry.map_err(failed(&absolute))?;
            let path = folder.join(entry.file_name());
            if entry.path().is_dir() {
                self.read_folder(root, &path)?;
            } else if path.extension().is_some_and(|e| e == "rs") {
                self.files.insert(path, read_text(&entry.path())?);
            }
        }
        Ok(())
    }
}

/// The text of a file.
pub fn read_text(path: &Path) -> Result<String, StructureError> {
    std::fs::read_to_string(path).map_err(|source| StructureError::Read { path: path.to_owned(), source })
}
