//! The input of a report, and the reasons why there may be none.

pub use depthcal_calibration::task::{
    Made, ReportCamera, ReportDataset, ReportDiagnosis, ReportInput, ReportRig, Role,
};
use thiserror::Error;

/// Why there is no report.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReportError {
    /// There is neither a calibration nor an evaluated frame.
    #[error(
        "there is nothing to report: neither a calibration nor an evaluated frame was given; evaluate the calibration \
         on a dataset in which the board was found"
    )]
    Nothing,
    /// The plotting library has no script to embed.
    #[error("the plotting library of this build has no script to embed: build with the locked dependencies")]
    NoScript,
}
