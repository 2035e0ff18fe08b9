//! Declarations of datasets, tables of frames, and lists of files.

use std::path::Path;

use depthcal_io::{DATASET_FILE, Dataset, DatasetFile};

use super::memory_folder;

const BOARD: &str = "[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 20\n";

/// Parses a `dataset.toml`, of one camera or of several, and opens the dataset that it declares in a folder with three frames.
/// What is written again reads the same.
pub fn dataset_toml(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(file) = DatasetFile::parse(Path::new(DATASET_FILE), text) else { return };
    let written = file.to_toml().expect("a dataset.toml that was read is written");
    let again = DatasetFile::parse(Path::new(DATASET_FILE), &written).expect("a dataset.toml that was written is read");
    assert_eq!(file, again);
    let root = captures("declared");
    std::fs::write(root.join(DATASET_FILE), text).expect("a temporary file");
    if let Ok(dataset) = Dataset::open(&root) {
        // The file of intrinsics may be absent.
        let _ = dataset.cameras[0].digest();
        assert_inside(&root, &dataset);
    }
}

/// Opens datasets whose table of frames is these bytes: beside globs, and with the files in the table.
pub fn frames_table(bytes: &[u8]) {
    for (name, frames) in [
        (
            "beside",
            "[frames]\nimage = \"image/*.png\"\ndepth = \"depth/*.png\"\nmetadata = \"frames.csv\"\n[depth]\nunit_mm = 1\n",
        ),
        ("table", "[frames]\nmetadata = \"frames.csv\"\n[depth]\nunit_mm = 1\n"),
    ] {
        open_with(name, frames, "frames.csv", bytes);
    }
}

/// Opens datasets whose list of images, or list of pairs, is these bytes.
pub fn frame_lists(bytes: &[u8]) {
    for (name, frames) in [
        ("list", "[frames]\nimage = \"list.txt\"\n"),
        ("lists", "[frames]\nimage = \"list.txt\"\ndepth = \"list.txt\"\n[depth]\nunit_mm = 1\n"),
        ("pairs", "[frames]\nassociations = \"list.txt\"\n[depth]\nunit_mm = 1\n"),
    ] {
        open_with(name, frames, "list.txt", bytes);
    }
}

fn open_with(name: &str, frames: &str, table: &str, bytes: &[u8]) {
    let root = captures(name);
    let declaration = root.join(DATASET_FILE);
    if !declaration.exists() {
        std::fs::write(declaration, format!("{BOARD}{frames}")).expect("a temporary file");
    }
    std::fs::write(root.join(table), bytes).expect("a temporary file");
    if let Ok(dataset) = Dataset::open(&root) {
        assert_inside(&root, &dataset);
    }
}

fn assert_inside(root: &Path, dataset: &Dataset) {
    let folder = root.canonicalize().expect("the folder is there");
    let frames = dataset.cameras.iter().flat_map(|camera| &camera.frames);
    for path in frames.flat_map(|frame| frame.image.iter().chain(&frame.depth)) {
        let path = path.canonicalize().expect("files of frames are there");
        assert!(path.starts_with(&folder), "{} lies outside of the dataset", path.display());
    }
}

/// A folder with images and depth of three frames, which are empty: datasets are opened without reading images.
fn captures(name: &str) -> std::path::PathBuf {
    let root = memory_folder::path(name);
    if !root.exists() {
        for frame in ["1", "2", "3"] {
            memory_folder::file(&format!("{name}/image/{frame}.png"), b"");
            memory_folder::file(&format!("{name}/depth/{frame}.png"), b"");
        }
    }
    root
}
