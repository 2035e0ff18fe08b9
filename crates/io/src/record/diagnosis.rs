//! `diagnosis.json`: the diagnosis of every camera, and of a rig its errors before and after.

use std::path::Path;

use serde::de::IgnoredAny;
use serde::ser::Error;
use serde::{Deserialize, Serialize, Serializer};

use super::camera_diagnosis::{CameraDiagnosis, GainInterval, Verdict};
use super::evaluation::Evaluation;
use super::extrinsics::DriftRecord;
use super::reference::FileReference;
use super::result_file::result_file;
use crate::dataset::CAMERA;
use crate::file::{FileError, read_json, write_json};

/// Result of `depthcal diagnose`.
///
/// The file of one camera without a name is its diagnosis alone ([`CameraDiagnosis`]); that of a rig lists the diagnoses of its
/// cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// The dataset.
    pub dataset: FileReference,
    /// The worst of the cameras' verdicts.
    pub verdict: Verdict,
    /// The cameras with depth.
    pub cameras: Vec<DiagnosedCamera>,
    /// Of a rig, what concerns its cameras together.
    pub rig: Option<RigFindings>,
}

result_file!(Diagnosis, "diagnosis.json", read, write_json);

/// Findings on the cameras of a rig together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigFindings {
    /// Cameras without depth, which are not examined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without_depth: Vec<String>,
    /// Extrinsics that may change with time or temperature; empty where that cannot be tested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extrinsics_drift: Vec<RigDriftTest>,
    /// Errors on frames that no fit of the rig saw.
    pub held_out: RigHeldOut,
}

/// The fields of the file of a rig.
#[derive(Serialize, Deserialize, schemars::JsonSchema)]
#[schemars(rename = "RigDiagnosis", description = "Result of `depthcal diagnose` on a rig.")]
pub(crate) struct RigDiagnosis {
    /// The dataset.
    dataset: FileReference,
    /// The worst of the cameras' verdicts.
    verdict: Verdict,
    /// The cameras with depth.
    cameras: Vec<DiagnosedCamera>,
    #[serde(flatten)]
    findings: RigFindings,
}

/// The diagnosis of one camera of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosedCamera {
    /// The camera.
    pub camera: String,
    /// Whether the poses of the board come from the other cameras, because this one has no images.
    #[serde(default)]
    pub poses_from_others: bool,
    /// Effects that the joint adjustment of the rig took over, as for `calibrate --with`.
    pub effects: Vec<String>,
    /// Those of `effects` that other cameras show of the board, and that the loop is given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub of_board: Vec<String>,
    /// Those of `effects` that the joint adjustment showed before the loop, which is given them: of a camera without images.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub in_rig: Vec<RigEffect>,
    /// The loop on this camera alone.
    pub diagnosis: CameraDiagnosis,
}

/// Whether the extrinsics of a camera change with time or temperature: the effect `extrinsics_drift`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigDriftTest {
    /// The camera.
    pub camera: String,
    /// The change that fits its frames best.
    pub drift: DriftRecord,
    /// Probability of as large a change by noise alone, corrected for the number of tests.
    pub p_value: f64,
    /// Errors on left-out frames; absent where the p-value gives no reason to look at them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<RigLeftOut>,
    /// Whether it is part of the calibration.
    pub added: bool,
}

/// An effect of a camera without images that the joint adjustment showed, in which its pinhole, lens and extrinsics are free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigEffect {
    /// The effect, as for `calibrate --with`.
    pub effect: String,
    /// Errors on left-out frames without it and with it.
    pub left_out: RigLeftOut,
}

/// Errors of a camera's observations of a board that the other cameras place, on left-out frames, root mean square in standard
/// deviations of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigLeftOut {
    /// Without what was tried: an effect, or extrinsics that change.
    pub before: f64,
    /// With it.
    pub after: f64,
    /// Its fall, per cent, with a 95 % interval over frames.
    pub gain_percent: GainInterval,
}

/// Errors of a rig on frames that it was not fitted to: of every camera with images, and from camera to camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigHeldOut {
    /// With the declared models.
    pub before: Evaluation,
    /// With what was added.
    pub after: Evaluation,
}

/// The field that only the file of a rig has, by which it is told from that of one camera.
#[derive(Deserialize)]
struct Form {
    cameras: Option<IgnoredAny>,
}

fn read(path: &Path) -> Result<Diagnosis, FileError> {
    if read_json::<Form>(path)?.cameras.is_none() {
        return read_json::<CameraDiagnosis>(path).map(Diagnosis::from);
    }
    let RigDiagnosis { dataset, verdict, cameras, findings } = read_json(path)?;
    Ok(Diagnosis { dataset, verdict, cameras, rig: Some(findings) })
}

impl From<CameraDiagnosis> for Diagnosis {
    /// The diagnosis of one camera without a name.
    fn from(diagnosis: CameraDiagnosis) -> Self {
        let (dataset, verdict) = (diagnosis.dataset.clone(), diagnosis.verdict);
        Self { dataset, verdict, cameras: vec![DiagnosedCamera::alone(CAMERA.to_owned(), diagnosis)], rig: None }
    }
}

impl Serialize for Diagnosis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (&self.rig, self.cameras.as_slice()) {
            (None, [camera]) => camera.diagnosis.serialize(serializer),
            (None, _) => Err(S::Error::custom("a diagnosis of several cameras has findings of the rig")),
            (Some(findings), _) => {
                let Self { dataset, verdict, cameras, .. } = self.clone();
                RigDiagnosis { dataset, verdict, cameras, findings: findings.clone() }.serialize(serializer)
            }
        }
    }
}

impl DiagnosedCamera {
    /// The diagnosis of a camera that is adjusted alone.
    pub fn alone(camera: String, diagnosis: CameraDiagnosis) -> Self {
        Self {
            camera,
            poses_from_others: false,
            effects: Vec::new(),
            of_board: Vec::new(),
            in_rig: Vec::new(),
            diagnosis,
        }
    }
}
