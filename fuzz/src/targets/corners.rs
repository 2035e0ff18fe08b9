//! Corners that another program found.

use depthcal_io::read_corners;

use super::memory_folder;

/// Reads a file of corners.
pub fn corners(bytes: &[u8]) {
    let path = memory_folder::file("corners.vnl", bytes);
    if let Ok(images) = read_corners(&path) {
        assert!(images.iter().all(|image| !image.lines.is_empty()));
    }
}
