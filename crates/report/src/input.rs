//! What a report is made from, and why there may be none.

use depthcal_calibration::calibrate::Calibrated;
use depthcal_calibration::judge::evaluate::Evaluated;
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_io::DiagnosisFile;
use depthcal_model::Register;
use thiserror::Error;

/// How a dataset's frames relate to the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Frames that the camera was fitted to: their errors are too small as an estimate for new frames.
    Fitted,
    /// Frames of the same capture that were left out of the fit.
    HeldOut,
    /// Frames of another capture, none of which was part of the fit.
    Other,
}

impl Role {
    /// The role in the report's words: `fitted`, `held out` or `other capture`.
    pub fn name(self) -> &'static str {
        match self {
            Role::Fitted => "fitted",
            Role::HeldOut => "held out",
            Role::Other => "other capture",
        }
    }
}

/// An evaluated dataset and its role in the fit.
#[derive(Debug, Clone, Copy)]
pub struct ReportDataset<'a> {
    /// Errors of its frames.
    pub evaluated: &'a Evaluated,
    /// Whether the camera was fitted to these frames.
    pub role: Role,
}

/// A diagnosis: its record, and the errors of the model that was declared. The report's calibration is the last model.
#[derive(Debug, Clone, Copy)]
pub struct ReportDiagnosis<'a> {
    /// The record, as in `diagnosis.json`.
    pub record: &'a DiagnosisFile,
    /// Held-out errors of the declared model.
    pub before: &'a Evaluated,
    /// The pieces that the record names.
    pub register: &'a Register,
}

impl<'a> ReportDiagnosis<'a> {
    /// Names of the added effects, in the order in which they were added.
    pub(crate) fn added(&self) -> Vec<&'a str> {
        self.record.steps.iter().filter_map(|s| s.effects.first().map(String::as_str)).collect()
    }
}

/// Everything that a report is made from.
///
/// With `calibrated` the report has parameters, uncertainty and noise; with `evaluations` it has errors before and after
/// correction. Either may be missing, but not both.
#[derive(Debug, Clone, Default)]
pub struct ReportInput<'a> {
    /// Heading, usually the dataset's name.
    pub title: String,
    /// The command that made the report; shown below the heading.
    pub command_line: String,
    /// How long its stages took, up to the report; shown below the command. Nothing is shown where there are none.
    pub stages: StageTimes,
    /// The calibration.
    pub calibrated: Option<&'a Calibrated>,
    /// Evaluated datasets, in the order in which they are shown.
    pub evaluations: &'a [ReportDataset<'a>],
    /// The diagnosis that led to the calibration.
    pub diagnosis: Option<ReportDiagnosis<'a>>,
    /// Sentences that introduce the report, such as what was simulated and what the model does not declare.
    pub story: &'a [String],
}

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
