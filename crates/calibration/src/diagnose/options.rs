//! Options of a diagnosis.

use super::thresholds::Thresholds;
use crate::calibrate::{CalibrateOptions, CameraOptions};

/// Options of a capture's diagnosis.
#[derive(Debug, Clone)]
pub struct DiagnoseOptions {
    /// The declared models: those that are examined first. Planes of whole frames are tested, and are part of the last fit of
    /// several cameras alone.
    pub calibrate: CalibrateOptions,
    /// Cross-validation folds of every camera's diagnosis; one frame in as many is held out of the errors of several cameras
    /// where no other dataset is given.
    pub folds: usize,
    /// Whether formulas are searched for what the effects of the register leave unexplained.
    pub formulas: bool,
    /// Thresholds of the rules.
    pub thresholds: Thresholds,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        let CameraDiagnoseOptions { folds, formulas, thresholds, .. } = CameraDiagnoseOptions::default();
        Self { calibrate: CalibrateOptions::default(), folds, formulas, thresholds }
    }
}

impl DiagnoseOptions {
    /// Options for one camera, with its model.
    pub(super) fn of(&self, calibrate: CameraOptions) -> CameraDiagnoseOptions {
        let Self { folds, formulas, thresholds, .. } = *self;
        CameraDiagnoseOptions { calibrate, folds, formulas, thresholds }
    }
}

/// Options of one camera's diagnosis.
#[derive(Debug, Clone)]
pub struct CameraDiagnoseOptions {
    /// The declared model: the one that is examined first. Its `frame_planes` are not used: planes of whole frames are tested,
    /// and would otherwise hide effects that change from frame to frame.
    pub calibrate: CameraOptions,
    /// Number of cross-validation folds where no other dataset is given for verification.
    pub folds: usize,
    /// Whether formulas are searched for what the effects of the register leave unexplained.
    pub formulas: bool,
    /// Thresholds of the rules.
    pub thresholds: Thresholds,
}

impl Default for CameraDiagnoseOptions {
    fn default() -> Self {
        let calibrate = CameraOptions { frame_planes: false, ..CameraOptions::default() };
        Self { calibrate, folds: 5, formulas: true, thresholds: Thresholds::default() }
    }
}
