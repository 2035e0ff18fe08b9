//! Measured captures, which are not part of the repository.

#[path = "../../../../tests/support/measured.rs"]
mod data;

use depthcal_io::{Dataset, GrayImage, read_gray};
use depthcal_model::target::Target;

/// The board that a measured dataset declares and its images with their names.
pub struct Capture {
    pub target: Target,
    pub frames: Vec<(String, GrayImage)>,
}

/// A measured dataset; `None` where it is not present, and the test is then reported as skipped.
///
/// # Panics
/// When the dataset is at fault.
pub fn capture(dataset: &str) -> Option<Capture> {
    let dataset = Dataset::open(data::measured(dataset)?).and_then(Dataset::into_only_camera).expect("a dataset");
    let frames = dataset
        .frames
        .iter()
        .filter_map(|f| Some((f.name.clone(), read_gray(f.image.as_ref()?).expect("an image"))))
        .collect();
    Some(Capture { target: dataset.target, frames })
}

/// The image as OpenCV's detectors take it: 8 bits, 16-bit amplitudes scaled between their least and largest value.
pub fn bytes(image: &GrayImage) -> Vec<u8> {
    if image.bits <= 8 {
        return image.data.iter().map(|&v| v as u8).collect();
    }
    let low = image.data.iter().copied().min().unwrap_or(0);
    let range = f64::from(image.data.iter().copied().max().unwrap_or(1) - low).max(1.0);
    image.data.iter().map(|&v| (f64::from(v - low) * 255.0 / range).round() as u8).collect()
}
