//! Measured captures, which are not part of the repository.

#[path = "../../../../tests/support/measured.rs"]
mod data;

use std::path::PathBuf;

use depthcal_io::GrayImage;
use opencv::core::{MatTraitConst, MatTraitConstManual};

/// Images of a measured dataset with their file names; `None` where the dataset is not present, and the
/// test is then reported as skipped.
///
/// # Panics
/// When the dataset's folder holds no images.
pub fn images(dataset: &str, folder: &str) -> Option<Vec<(String, GrayImage)>> {
    let path = data::measured(&format!("{dataset}/{folder}"))?;
    let entries = std::fs::read_dir(&path).expect("a folder");
    let mut files: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    files.sort();
    assert!(!files.is_empty(), "{} holds no images", path.display());
    Some(files.into_iter().map(|file| (file.display().to_string(), read(&file))).collect())
}

fn read(file: &std::path::Path) -> GrayImage {
    let flags = opencv::imgcodecs::IMREAD_ANYDEPTH | opencv::imgcodecs::IMREAD_GRAYSCALE;
    let mat = opencv::imgcodecs::imread(file, flags).expect("an image");
    let (width, height) = (mat.cols() as usize, mat.rows() as usize);
    if mat.depth() == opencv::core::CV_16U {
        GrayImage { width, height, data: mat.data_typed::<u16>().expect("16 bits").to_vec(), bits: 16 }
    } else {
        let data = mat.data_typed::<u8>().expect("8 bits").iter().map(|&v| u16::from(v)).collect();
        GrayImage { width, height, data, bits: 8 }
    }
}
