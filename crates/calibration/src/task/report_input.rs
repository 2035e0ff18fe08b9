//! What a report is made from.

use depthcal_io::{CameraDiagnosis, Diagnosis};
use depthcal_model::Register;

use super::made::Made;
use crate::calibrate::Calibrated;
use crate::judge::evaluate::Evaluated;
use crate::judge::rig::EvaluatedRig;
use crate::observe::PlacedCamera;

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

impl<'a> ReportDataset<'a> {
    /// The errors of the reference on a dataset of its rig; none where it was not evaluated.
    pub fn of_reference(rig: &'a EvaluatedRig, role: Role) -> Vec<Self> {
        rig.cameras.first().map(|evaluated| Self { evaluated, role }).into_iter().collect()
    }
}

/// A diagnosis: its record, and the errors of the model that was declared. The report's calibration is the last model.
#[derive(Debug, Clone, Copy)]
pub struct ReportDiagnosis<'a> {
    /// The record, as in `diagnosis.json`.
    pub record: &'a CameraDiagnosis,
    /// Held-out errors of the declared model.
    pub before: &'a Evaluated,
    /// The pieces that the record names.
    pub register: &'a Register,
}

impl<'a> ReportDiagnosis<'a> {
    /// Names of the added effects, in the order in which they were added.
    pub fn added(&self) -> Vec<&'a str> {
        self.record.steps.iter().filter_map(|s| s.effects.first().map(String::as_str)).collect()
    }
}

/// What a report shows of a rig besides its reference camera.
#[derive(Debug, Clone)]
pub struct ReportRig<'a> {
    /// The cameras with their extrinsics.
    pub cameras: Vec<PlacedCamera>,
    /// Their record, for standard deviations and counts.
    pub record: &'a depthcal_io::Calibration,
    /// Errors on every dataset, the fitted one first.
    pub evaluated: Vec<&'a EvaluatedRig>,
    /// The diagnosis that led to the calibration.
    pub diagnosis: Option<&'a Diagnosis>,
}

/// Everything that a report is made from.
///
/// With `calibrated` the report has parameters, uncertainty and noise; with `evaluations` it has errors before and after
/// correction. Either may be missing, but not both.
#[derive(Debug, Clone, Default)]
pub struct ReportInput<'a> {
    /// Heading, usually the dataset's name.
    pub title: String,
    /// How the results were made; shown below the heading.
    pub made: Made,
    /// The calibration; of a rig that of the reference.
    pub calibrated: Option<&'a Calibrated>,
    /// Evaluated datasets of the camera, of a rig of the reference, in the order in which they are shown.
    pub evaluations: Vec<ReportDataset<'a>>,
    /// The diagnosis of the camera that led to the calibration.
    pub diagnosis: Option<ReportDiagnosis<'a>>,
    /// All cameras of a rig.
    pub rig: Option<ReportRig<'a>>,
    /// Sentences that introduce the report, such as what was simulated and what the model does not declare.
    pub story: &'a [String],
}
