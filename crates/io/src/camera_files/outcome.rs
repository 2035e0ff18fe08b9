//! The result of an export.

use super::text::shown;

/// An exported file, with warnings of what it does not hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// The contents of the file.
    pub text: String,
    /// Properties of the camera that the file does not hold, to be shown to the user.
    pub warnings: Vec<ExportWarning>,
}

/// A property of the camera that a format, or the programs that read it, cannot represent.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportWarning {
    /// Skew or lens, which are replaced by the nearest camera that the format can hold.
    #[error("{format} cannot hold {}: written is the nearest {written}, {}", lost.join(", "), error_in_words(*largest_px))]
    Approximated {
        /// Name of the format.
        format: &'static str,
        /// Properties that the format cannot hold.
        lost: Vec<String>,
        /// The lens model that was written, in the format's words.
        written: &'static str,
        /// Largest distance over the image between the pixels that both cameras give a ray, px; infinite where a pixel has no ray
        /// in the file's camera.
        largest_px: f64,
    },
    /// Pixels of the camera without a ray, whatever the format.
    #[error("the lens has no inverse at {} % of the image: nothing can be said of these pixels", shown(*share_percent))]
    NoRays {
        /// Share of the image, per cent.
        share_percent: f64,
    },
    /// The model of the depth error.
    #[error("{format} has no depth model: {} left out; correct depth images with calibration.json", pieces.join(", "))]
    Depth {
        /// Name of the format.
        format: &'static str,
        /// Names of the pieces.
        pieces: Vec<String>,
    },
}

fn error_in_words(px: f64) -> String {
    if px.is_finite() {
        format!("which is off by at most {} px over the image", shown(px))
    } else {
        "which has no ray for a part of the image".to_owned()
    }
}
