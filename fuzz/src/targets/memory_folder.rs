//! A folder for readers that take a path: in `TMPDIR` where that is set, else in memory where the system has such a folder, so
//! that a fuzzer is not slowed by a disk. A fuzzer ends without removing it; `run-all.sh` does.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

thread_local! {
    static FOLDER: TempDir = new();
}

fn new() -> TempDir {
    let memory = Path::new("/dev/shm");
    let is_chosen = std::env::var_os("TMPDIR").is_some();
    let parent = if memory.is_dir() && !is_chosen { memory.to_owned() } else { std::env::temp_dir() };
    tempfile::Builder::new().prefix("depthcal-fuzz-").tempdir_in(parent).expect("a folder for temporary files")
}

/// The path of `name` in this thread's folder.
pub fn path(name: &str) -> PathBuf {
    FOLDER.with(|folder| folder.path().join(name))
}

/// Writes a file of this name into this thread's folder, and gives its path.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = path(name);
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).expect("a folder for temporary files");
    }
    std::fs::write(&path, bytes).expect("a temporary file");
    path
}
