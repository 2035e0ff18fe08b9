//! A digest of files, which tells whether a cached result is still valid.

use std::fs::File;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::error::FileError;

/// Digest (BLAKE3, 64 hexadecimal digits) of the names and contents of `files`.
///
/// Names are taken relative to `root`, so that a dataset may be moved. The digest does not depend on the order of
/// `files`, on duplicates among them, or on dates.
///
/// # Errors
/// [`FileError::Read`] names the file that cannot be read.
pub fn digest_files(root: &Path, files: &[PathBuf]) -> Result<String, FileError> {
    let mut entries = files
        .par_iter()
        .map(|path| {
            let digest = digest_file(path).map_err(|error| FileError::Read { path: path.clone(), error })?;
            Ok((relative_name(root, path), digest))
        })
        .collect::<Result<Vec<_>, _>>()?;
    entries.sort_by(|a, b| a.0.cmp(&b.0).then_with(|| a.1.as_bytes().cmp(b.1.as_bytes())));
    entries.dedup();
    Ok(digest_entries(&entries))
}

/// Digest of named contents in memory, in their order, as [`digest_files`] has it for files.
pub fn digest_contents(contents: impl IntoIterator<Item = (String, Vec<u8>)>) -> String {
    let entries: Vec<_> = contents.into_iter().map(|(name, bytes)| (name, blake3::hash(&bytes))).collect();
    digest_entries(&entries)
}

/// Digest (BLAKE3, 64 hexadecimal digits) of a value as JSON; `None` where it cannot be written as such.
pub fn digest_json(value: &impl Serialize) -> Option<String> {
    serde_json::to_vec(value).ok().map(|bytes| blake3::hash(&bytes).to_hex().to_string())
}

fn digest_entries(entries: &[(String, blake3::Hash)]) -> String {
    let mut all = blake3::Hasher::new();
    for (name, digest) in entries {
        // The length separates a name from what follows it.
        all.update(&(name.len() as u64).to_le_bytes()).update(name.as_bytes()).update(digest.as_bytes());
    }
    all.finalize().to_hex().to_string()
}

fn digest_file(path: &Path) -> std::io::Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path)?)?;
    Ok(hasher.finalize())
}

/// The path relative to `root`, with slashes on every system.
fn relative_name(root: &Path, path: &Path) -> String {
    let relative = path.strip_prefix(root).unwrap_or(path);
    let parts: Vec<_> = relative.components().map(|part| part.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn depends_on_names_and_contents_alone() {
        let digest_in = |folder: &Path, reverse: bool| {
            let mut files = vec![folder.join("a"), folder.join("b")];
            if reverse {
                files.reverse();
                files.push(folder.join("a"));
            }
            digest_files(folder, &files)
        };
        let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for folder in [one.path(), two.path()] {
            fs::write(folder.join("a"), "first").unwrap();
            fs::write(folder.join("b"), "second").unwrap();
        }
        let digest = digest_in(one.path(), false).unwrap();
        assert_eq!(digest.len(), 64);
        assert_eq!(digest, digest_in(one.path(), true).unwrap());
        assert_eq!(digest, digest_in(two.path(), false).unwrap());
        fs::rename(two.path().join("a"), two.path().join("c")).unwrap();
        assert!(digest_in(two.path(), false).unwrap_err().to_string().contains("cannot read"));
        fs::rename(two.path().join("b"), two.path().join("a")).unwrap();
        fs::rename(two.path().join("c"), two.path().join("b")).unwrap();
        assert_ne!(digest, digest_in(two.path(), false).unwrap());
    }
}
