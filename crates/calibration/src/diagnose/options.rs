//! Options of a diagnosis.

use super::thresholds::Thresholds;
use crate::calibrate::CalibrateOptions;

/// Options of a diagnosis.
#[derive(Debug, Clone)]
pub struct DiagnoseOptions {
    /// The declared model: the one that is examined first. Its `frame_planes` are not used: planes of whole frames are tested,
    /// and would otherwise hide effects that change from frame to frame.
    pub calibrate: CalibrateOptions,
    /// Number of cross-validation folds where no other dataset is given for verification.
    pub folds: usize,
    /// Whether formulas are searched for what the effects of the register leave unexplained.
    pub formulas: bool,
    /// Thresholds of the rules.
    pub thresholds: Thresholds,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        let calibrate = CalibrateOptions { frame_planes: false, ..CalibrateOptions::default() };
        Self { calibrate, folds: 5, formulas: true, thresholds: Thresholds::default() }
    }
}
