//! The register and the progress bars that the commands of one run share.

use depthcal_calibration::calibrate::CalibrateOptions;
use depthcal_calibration::progress::ProgressHandle;
use depthcal_model::Register;

use crate::progress::Bars;

/// The known pieces, and where progress is shown.
#[derive(Debug)]
pub(crate) struct Session {
    /// Pieces of depthcal and of the program that runs the command line.
    pub(crate) register: Register,
    /// Bars on terminals.
    pub(crate) progress: ProgressHandle,
}

impl Session {
    /// A session with these pieces.
    pub(crate) fn new(register: Register) -> Self {
        Self { register, progress: ProgressHandle::new(Bars) }
    }

    /// Default options of a fit with this session's pieces and progress.
    pub(crate) fn calibrate_options(&self) -> CalibrateOptions {
        CalibrateOptions {
            register: self.register.clone(),
            progress: self.progress.clone(),
            ..CalibrateOptions::default()
        }
    }
}
