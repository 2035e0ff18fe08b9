//! The register, the progress bars and the clock that the commands of one run share.

use std::sync::atomic::{AtomicBool, Ordering};

use depthcal_calibration::calibrate::CameraOptions;
use depthcal_calibration::progress::ProgressHandle;
use depthcal_model::{ModelSpec, Register};

use super::failure::Failure;
use crate::progress::Bars;

/// The known pieces, and where progress is shown.
#[derive(Debug)]
pub(crate) struct Session {
    /// Pieces of depthcal and of the program that runs the command line.
    pub(crate) register: Register,
    /// Bars on terminals, and the times of the run's stages.
    pub(crate) progress: ProgressHandle,
    /// Whether the run has replaced results.
    has_committed: AtomicBool,
}

impl Session {
    /// A session with these pieces.
    pub(crate) fn new(register: Register) -> Self {
        Self { register, progress: ProgressHandle::new(Bars), has_committed: AtomicBool::new(false) }
    }

    /// The run has replaced results.
    pub(crate) fn committed(&self) {
        self.has_committed.store(true, Ordering::Relaxed);
    }

    /// Whether the run has replaced results.
    pub(crate) fn has_committed(&self) -> bool {
        self.has_committed.load(Ordering::Relaxed)
    }

    /// The depth model that an option names.
    pub(crate) fn model(&self, option: &str, text: &str) -> Result<ModelSpec, Failure> {
        self.register.model_spec(text).map_err(|e| Failure::Input(format!("{option} {text}: {e}")))
    }

    /// Default options of a fit with this session's pieces and progress.
    pub(crate) fn calibrate_options(&self) -> CameraOptions {
        CameraOptions { register: self.register.clone(), progress: self.progress.clone(), ..CameraOptions::default() }
    }
}
