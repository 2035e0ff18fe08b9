//! Recordings, imported as a whole: container, messages, pictures, the choice of frames, and the dataset that is written.

use depthcal_import::{ImportOptions, import};
use depthcal_io::{DATASET_FILE, Dataset};

use super::memory_folder;

/// An MCAP.
pub fn mcap(bytes: &[u8]) {
    imported("recording.mcap", bytes);
}

/// A ROS 2 bag in SQLite.
pub fn db3(bytes: &[u8]) {
    imported("recording.db3", bytes);
}

/// A ROS 1 bag.
pub fn bag(bytes: &[u8]) {
    imported("recording.bag", bytes);
}

/// A Matroska file.
pub fn mkv(bytes: &[u8]) {
    imported("recording.mkv", bytes);
}

fn imported(name: &str, bytes: &[u8]) {
    let path = memory_folder::file(name, bytes);
    let out = memory_folder::path("imported");
    let _ = std::fs::remove_dir_all(&out);
    let options = ImportOptions { frames: 4, ..ImportOptions::default() };
    let Ok(imported) = import(&path, &out, &options) else { return };
    // The board is not known: with one, what was written is a dataset.
    let board = "[board]\nkind = \"chessboard\"\ncolumns = 8\nrows = 5\nspacing_mm = 20.0\n";
    let text = std::fs::read_to_string(out.join(DATASET_FILE)).expect("a dataset.toml is written");
    std::fs::write(out.join(DATASET_FILE), format!("{board}{text}")).expect("a temporary file");
    if imported.frames > 0 {
        let dataset = Dataset::open(&out).expect("an imported dataset is opened");
        assert_eq!(dataset.cameras[0].frames.len(), imported.frames);
    }
}
