//! Datasets that are written whole: a folder is one, or it is empty.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::error::FileError;
use super::write::{synchronise, write_atomically};

/// Folder inside the dataset's folder, in which the parts are written until all are complete.
const STAGING: &str = ".depthcal-dataset.tmp";
/// Lists the parts, once they are complete and are being moved.
const MOVING: &str = "moving";

/// A dataset that is being written, in a hidden folder within its folder.
///
/// [`commit`](Self::commit) moves its parts into their places, the file that makes a folder a dataset last. What a killed run
/// left, hidden or moved already, is removed by the next run that begins one there.
#[derive(Debug)]
pub struct StagedDataset {
    out: PathBuf,
    /// The file that makes a folder a dataset.
    last: String,
    /// Whether the folder existed before.
    existed: bool,
    /// Held while the hidden folder is in use, where the system locks folders.
    _lock: Option<File>,
}

impl StagedDataset {
    /// Prepares a dataset for the folder `out`, which is created if it does not exist. `last` is the file that makes a folder a
    /// dataset.
    ///
    /// # Errors
    /// [`FileError::Write`] with the folder: it cannot be written, or another run is writing a dataset into it.
    pub fn within(out: &Path, last: &str) -> Result<Self, FileError> {
        let existed = out.exists();
        let staging = out.join(STAGING);
        let unwritable = |error| FileError::Write { path: out.to_owned(), error };
        if let Ok(left) = File::open(&staging)
            && let Err(TryLockError::WouldBlock) = left.try_lock()
        {
            let message = "another run is writing a dataset into this folder: wait for its end";
            return Err(unwritable(io::Error::new(io::ErrorKind::ResourceBusy, message)));
        }
        take_back(out, last).map_err(unwritable)?;
        fs::create_dir_all(&staging).map_err(unwritable)?;
        let lock = File::open(&staging).ok().filter(|folder| folder.try_lock().is_ok());
        Ok(Self { out: out.to_owned(), last: last.to_owned(), existed, _lock: lock })
    }

    /// The folder to write the dataset into.
    pub fn folder(&self) -> PathBuf {
        self.out.join(STAGING)
    }

    /// An error of writing, told of the place where the file was to be in the end.
    pub fn located(&self, error: FileError) -> FileError {
        error.moved(&self.folder(), &self.out)
    }

    /// Moves the dataset into its place.
    ///
    /// # Errors
    /// [`FileError::Write`] with the part that cannot be moved, or whose name is in use; the folder is then as it was.
    pub fn commit(self) -> Result<(), FileError> {
        let staging = self.folder();
        let unwritable = |error| FileError::Write { path: self.out.clone(), error };
        let mut parts = Vec::new();
        for entry in fs::read_dir(&staging).map_err(unwritable)? {
            parts.push(entry.map_err(unwritable)?.file_name().to_string_lossy().into_owned());
        }
        parts.sort_by_key(|name| (*name == self.last, name.clone()));
        if let Some(path) = parts.iter().map(|name| self.out.join(name)).find(|path| path.exists()) {
            let message = "something of this name is here already, and would be mixed with the dataset: give a new or an empty folder";
            return Err(FileError::Write { path, error: io::Error::other(message) });
        }
        write_atomically(staging.join(MOVING), |file| file.write_all(parts.join("\n").as_bytes()))?;
        for name in &parts {
            let path = self.out.join(name);
            fs::rename(staging.join(name), &path).map_err(|error| FileError::Write { path, error })?;
        }
        synchronise(&self.out);
        Ok(())
    }
}

impl Drop for StagedDataset {
    /// Leaves a complete dataset, or the folder as it was.
    fn drop(&mut self) {
        // What cannot be removed now is removed by the next run.
        let _ = take_back(&self.out, &self.last);
        if !self.existed {
            // Fails where the folder is not empty, as it should.
            let _ = fs::remove_dir(&self.out);
        }
    }
}

/// Removes the hidden folder and, of a dataset that is not complete, the parts that were moved from it.
fn take_back(out: &Path, last: &str) -> io::Result<()> {
    let staging = out.join(STAGING);
    let parts = fs::read_to_string(staging.join(MOVING)).unwrap_or_default();
    if !out.join(last).exists() {
        // A part that is no longer in the hidden folder was moved by the run that this folder belongs to: `commit` begins only
        // where nothing of its name is in the way.
        for part in parts.lines().filter(|part| !staging.join(part).exists()).map(|part| out.join(part)) {
            let removed = if part.is_dir() { fs::remove_dir_all(&part) } else { fs::remove_file(&part) };
            found(removed)?;
        }
    }
    // The list goes last: without it nobody would know the moved parts.
    for entry in fs::read_dir(&staging).into_iter().flatten().flatten().filter(|entry| entry.file_name() != MOVING) {
        let path = entry.path();
        found(if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) })?;
    }
    found(fs::remove_dir_all(&staging))
}

/// Something that was not there need not be removed.
fn found(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::super::write::tests::names;
    use super::*;

    const LAST: &str = "dataset.toml";

    fn fill(staged: &StagedDataset) {
        for part in ["depth", "image"] {
            fs::create_dir(staged.folder().join(part)).unwrap();
            fs::write(staged.folder().join(part).join("1.png"), "pixels").unwrap();
        }
        for part in ["frames.csv", LAST] {
            fs::write(staged.folder().join(part), "text").unwrap();
        }
    }

    #[test]
    fn a_dataset_is_there_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/b");
        drop(StagedDataset::within(&out, LAST).unwrap());
        assert_eq!(names(&folder.path().join("a")), [""; 0]);
        let staged = StagedDataset::within(&out, LAST).unwrap();
        fill(&staged);
        let error = StagedDataset::within(&out, LAST).unwrap_err().to_string();
        assert!(error.contains("another run"), "{error}");
        staged.commit().unwrap();
        assert_eq!(names(&out), ["dataset.toml", "depth", "frames.csv", "image"]);
        let error = (|| {
            let staged = StagedDataset::within(&out, LAST)?;
            fill(&staged);
            staged.commit()
        })();
        assert!(error.unwrap_err().to_string().contains("dataset"));
        assert_eq!(names(&out), ["dataset.toml", "depth", "frames.csv", "image"]);
    }

    /// As if the program had been killed after so many parts were moved.
    #[test]
    fn what_a_killed_run_moved_is_taken_back() {
        for moved in 0..=4 {
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path();
            let staged = StagedDataset::within(out, LAST).unwrap();
            fill(&staged);
            let parts = ["depth", "frames.csv", "image", LAST];
            fs::write(staged.folder().join(MOVING), parts.join("\n")).unwrap();
            for part in &parts[..moved] {
                fs::rename(staged.folder().join(part), out.join(part)).unwrap();
            }
            std::mem::forget(staged);
            // The lock of a dead program is free.
            take_back(out, LAST).unwrap();
            let expected: &[&str] = if moved == 4 { &["dataset.toml", "depth", "frames.csv", "image"] } else { &[] };
            assert_eq!(names(out), expected, "{moved}");
        }
    }
}
