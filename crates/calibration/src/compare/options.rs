//! Options of a comparison.

use depthcal_model::{ModelSpec, PieceSpec};

use crate::calibrate::CameraOptions;

/// Options of a comparison.
#[derive(Debug, Clone)]
pub struct CompareOptions {
    /// Depth models.
    pub models: Vec<ModelSpec>,
    /// Options of every fit; model, lens and estimator are replaced by those of each variant.
    pub calibrate: CameraOptions,
    /// Number of cross-validation folds on the training frames where no other dataset is given.
    pub folds: usize,
    /// Whether the thesis' tables are made: all subsets of D, with and without lens, the four estimators, and D refitted to
    /// every dataset.
    pub thesis: bool,
    /// Numbers of frames of the learning curve; numbers that exceed the training dataset's are ignored.
    pub learning_sizes: Vec<usize>,
    /// Fits per number of frames of the learning curve, each to other frames.
    pub learning_fits: usize,
}

impl Default for CompareOptions {
    fn default() -> Self {
        Self {
            models: vec![
                ModelSpec::none(),
                ModelSpec::of(PieceSpec::new("projective").only("xw")),
                ModelSpec::of(PieceSpec::new("projective")),
            ],
            calibrate: CameraOptions::default(),
            folds: 6,
            thesis: true,
            learning_sizes: vec![4, 6, 8, 12, 16, 24, 32, 48],
            learning_fits: 3,
        }
    }
}
