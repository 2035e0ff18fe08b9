//! The result of an export.

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
    /// The skew of the pinhole.
    #[error("{format} has no skew: {value} px is {}", if *.written { "written but ignored" } else { "left out" })]
    Skew {
        /// Name of the format.
        format: &'static str,
        /// The skew, px.
        value: f64,
        /// Whether the file holds it, though readers ignore it.
        written: bool,
    },
    /// A coefficient of the lens.
    #[error(
        "{format} has no {coefficient}: {value} is left out, and the other coefficients do not make up for it; \
         calibrate with {coefficient} held at 0 for this format"
    )]
    Distortion {
        /// Name of the format.
        format: &'static str,
        /// Name of the coefficient.
        coefficient: &'static str,
        /// Its value.
        value: f64,
    },
    /// Pieces of the lens other than Brown–Conrady.
    #[error("{format} has no place for the lens pieces {}: pixels will be off where they matter", pieces.join(", "))]
    Lens {
        /// Name of the format.
        format: &'static str,
        /// Names of the pieces.
        pieces: Vec<String>,
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
