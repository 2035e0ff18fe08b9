//! The data that a report is made from.

use depthcal_io::{CameraDiagnosis, DiagnosisStep};
use depthcal_model::Register;

use super::made::Made;
use crate::calibrate::CalibratedCamera;
use crate::judge::camera::EvaluatedCamera;
use crate::judge::evaluate::Evaluated;
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
    pub evaluated: &'a EvaluatedCamera,
    /// Whether the camera was fitted to these frames.
    pub role: Role,
}

/// A diagnosis: its record, and the errors of the model that was declared. The report's calibration is the last model.
#[derive(Debug, Clone, Copy)]
pub struct ReportDiagnosis<'a> {
    /// The record, as in `diagnosis.json`.
    pub record: &'a CameraDiagnosis,
    /// Errors of the declared model on the frames on which those of the last one are reported.
    pub before: &'a EvaluatedCamera,
    /// The pieces that the record names.
    pub register: &'a Register,
}

impl<'a> ReportDiagnosis<'a> {
    /// Names of the added effects, in the order in which they were added.
    pub fn added(&self) -> Vec<&'a str> {
        self.record.steps.iter().filter_map(|s| s.effects.first().map(String::as_str)).collect()
    }

    /// Added effects of which it is certain, or not, that the depth error of left-out frames falls with them. Effects of images
    /// alone have no such gain and count as certain.
    pub fn steps_by_certainty(&self, certain: bool) -> Vec<&'a DiagnosisStep> {
        let is_certain = |step: &DiagnosisStep| step.gain().is_none_or(|gain| gain.is_certain());
        self.record.steps.iter().filter(|step| is_certain(step) == certain).collect()
    }
}

/// One camera of a report.
///
/// With `calibrated` the report has parameters, uncertainty and noise; with `evaluations` it has errors before and after
/// correction. Either may be missing, but not both.
#[derive(Debug, Clone, Default)]
pub struct ReportCamera<'a> {
    /// Its name.
    pub name: String,
    /// Its calibration.
    pub calibrated: Option<&'a CalibratedCamera>,
    /// Its evaluated datasets, in the order in which they are shown.
    pub evaluations: Vec<ReportDataset<'a>>,
    /// The diagnosis that led to the calibration.
    pub diagnosis: Option<ReportDiagnosis<'a>>,
    /// Effects that the joint adjustment with other cameras showed before, which the diagnosis is given.
    pub added_in_rig: Vec<&'a str>,
}

impl<'a> ReportCamera<'a> {
    /// A camera with its errors on datasets of its rig; those in which it was not evaluated are left out.
    pub fn of_rig(name: &str, calibrated: Option<&'a CalibratedCamera>, datasets: &[(&'a Evaluated, Role)]) -> Self {
        let evaluation = |(rig, role): &(&'a Evaluated, Role)| {
            rig.camera(name).map(|evaluated| ReportDataset { evaluated, role: *role })
        };
        let evaluations = datasets.iter().filter_map(evaluation).collect();
        Self { name: name.to_owned(), calibrated, evaluations, ..Self::default() }
    }

    /// Whether there is a calibration or a frame to report.
    pub fn has_content(&self) -> bool {
        let evaluated = |d: &ReportDataset<'_>| !d.evaluated.frames.is_empty() || !d.evaluated.dropped.is_empty();
        self.calibrated.is_some() || self.evaluations.iter().any(evaluated)
    }
}

/// Relations between the cameras of a rig.
#[derive(Debug, Clone)]
pub struct ReportRig<'a> {
    /// The cameras with their extrinsics.
    pub cameras: Vec<PlacedCamera>,
    /// Their record, for standard deviations and counts.
    pub record: &'a depthcal_io::Calibration,
    /// Errors on every dataset, the fitted one first.
    pub evaluated: Vec<&'a Evaluated>,
}

/// Everything that a report is made from.
#[derive(Debug, Clone, Default)]
pub struct ReportInput<'a> {
    /// Heading, usually the dataset's name.
    pub title: String,
    /// How the results were made; shown below the heading.
    pub made: Made,
    /// The cameras, the reference first.
    pub cameras: Vec<ReportCamera<'a>>,
    /// Their relations, where there are several.
    pub rig: Option<ReportRig<'a>>,
    /// Sentences that introduce the report, such as what was simulated and what the model does not declare.
    pub story: &'a [String],
}
