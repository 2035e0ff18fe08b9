//! Temporary names, and what killed runs left under them.
//!
//! A program that is killed cannot remove its temporary files. They are recognised by their names, `.NAME.RANDOM.depthcal.tmp`,
//! and a program that is alive holds a lock on each of its own: whatever has such a name and no lock is removed by the next run
//! that writes into the folder. Nothing depends on dates or process numbers, so that other machines may share the folder.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::{NamedTempFile, TempDir};

/// The end of every temporary name. The leading dot keeps globs such as `*.png` from matching.
const ENDING: &str = ".depthcal.tmp";

/// Folders in which this process has removed what others left; a folder of many frames is searched only once.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Whether a file or folder of this name is depthcal's own and temporary.
pub fn is_temporary(name: &std::ffi::OsStr) -> bool {
    let name = name.to_string_lossy();
    name.starts_with('.') && name.ends_with(ENDING)
}

/// A temporary file for the contents of `name`, in the same folder, locked as long as it is open.
pub(super) fn temporary_file(folder: &Path, name: &std::ffi::OsStr) -> io::Result<NamedTempFile> {
    sweep_once(folder);
    let prefix = prefix_of(name);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(ENDING);
    // Temporary files are private to the user by default; a result gets the permissions of any new file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    loop {
        let file = builder.tempfile_in(folder)?;
        if hold(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// A temporary folder within `folder`, and its lock, which keeps others from removing it.
pub(super) fn temporary_folder(folder: &Path, name: &str) -> io::Result<(TempDir, Option<File>)> {
    sweep_once(folder);
    let prefix = prefix_of(name.as_ref());
    loop {
        let made = tempfile::Builder::new().prefix(&prefix).suffix(ENDING).tempdir_in(folder)?;
        // Not every system opens folders; what is left there then stays.
        let Ok(lock) = File::open(made.path()) else { return Ok((made, None)) };
        if hold(&lock, made.path()) {
            return Ok((made, Some(lock)));
        }
    }
}

/// The system's error alone: tempfile adds the temporary name, which tells a reader of the message nothing.
pub(super) fn without_name(error: io::Error) -> io::Error {
    let text = error.to_string();
    match text.split_once(" at path ") {
        Some((told, _)) => io::Error::new(error.kind(), told.to_owned()),
        None => error,
    }
}

fn prefix_of(name: &std::ffi::OsStr) -> std::ffi::OsString {
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    prefix
}

/// Locks what was just made; `false` where another program took it for a left-over in between.
fn hold(file: &File, path: &Path) -> bool {
    // A file system without locks is no reason not to write.
    !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) && path.exists()
}

fn sweep_once(folder: &Path) {
    let is_first = SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned());
    if is_first {
        sweep(folder);
    }
}

/// Removes what programs that are no longer alive left in a folder.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let kind = entry.file_type();
        let is_folder = kind.as_ref().is_ok_and(fs::FileType::is_dir);
        // Links and pipes are not made by depthcal, and a pipe would block.
        if !is_temporary(&entry.file_name()) || !(is_folder || kind.is_ok_and(|kind| kind.is_file())) {
            continue;
        }
        let path = entry.path();
        // Without a lock nobody knows whether the owner is alive, so the file stays.
        if File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            let removed = if is_folder { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
            match removed {
                Ok(()) => tracing::info!("{}: removed, a killed run had left it", path.display()),
                Err(error) => {
                    tracing::info!("{}: a killed run left it, and it cannot be removed: {error}", path.display())
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::write::tests::names;
    use super::*;

    #[test]
    fn what_the_dead_left_is_removed_and_what_the_living_use_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let in_use = temporary_file(folder.path(), "a.json".as_ref()).unwrap();
        let (made, lock) = temporary_folder(folder.path(), "results").unwrap();
        fs::write(path(".a.json.Xy12ab.depthcal.tmp"), "half").unwrap();
        fs::create_dir_all(path(".results.Xy12ab.depthcal.tmp/effects")).unwrap();
        fs::write(path(".results.Xy12ab.depthcal.tmp/effects/a.toml"), "half").unwrap();
        for name in [".hidden.tmp", "a.depthcal.tmp", ".git"] {
            fs::write(path(name), "the user's").unwrap();
        }
        sweep(folder.path());
        let mine = [in_use.path(), made.path()].map(|p| p.file_name().unwrap().to_str().unwrap().to_owned());
        let mut expected = [&mine[..], &[".git", ".hidden.tmp", "a.depthcal.tmp"].map(str::to_owned)].concat();
        expected.sort();
        assert_eq!(names(folder.path()), expected);
        drop((in_use, lock, made));
        assert_eq!(names(folder.path()), [".git", ".hidden.tmp", "a.depthcal.tmp"]);
    }
}
