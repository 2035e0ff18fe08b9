//! `diagnosis.json` of a rig: the diagnosis of every camera, and the rig's errors before and after.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::diagnosis::{DiagnosisFile, GainInterval, Verdict};
use super::evaluation::Evaluation;
use super::reference::FileReference;
use super::rig_camera::DriftRecord;
use crate::file::{FileError, read_json, write_json};

/// Result of `depthcal diagnose` on a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigDiagnosisFile {
    /// The dataset.
    pub dataset: FileReference,
    /// The worst of the cameras' verdicts.
    pub verdict: Verdict,
    /// The cameras with depth.
    pub cameras: Vec<RigCameraDiagnosis>,
    /// Cameras without depth, which are not examined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without_depth: Vec<String>,
    /// Places that may change with time or temperature; empty where that cannot be tested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extrinsics_drift: Vec<RigDriftTest>,
    /// Errors on frames that no fit of the rig saw.
    pub held_out: RigHeldOut,
}

/// The diagnosis of one camera of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigCameraDiagnosis {
    /// The camera.
    pub camera: String,
    /// Whether the poses of the board come from the other cameras, because this one has no images.
    #[serde(default)]
    pub poses_from_others: bool,
    /// Effects that the joint adjustment of the rig took over, as for `calibrate --with`.
    pub effects: Vec<String>,
    /// Effects that were found and that it did not take over: free maps, and formulas whose names another camera's have.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_adjusted: Vec<String>,
    /// Those of `effects` that the joint adjustment showed before the loop, which is given them: of a camera without images.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub in_rig: Vec<RigEffect>,
    /// The loop on this camera alone.
    pub diagnosis: DiagnosisFile,
}

/// Whether the place of a camera changes with time or temperature: the effect `extrinsics_drift`.
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

/// An effect of a camera without images that the joint adjustment showed, in which its pinhole, lens and place are free.
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
    /// Without what was tried: an effect, or a place that changes.
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

impl RigDiagnosisFile {
    /// Reads `diagnosis.json` of a rig.
    ///
    /// # Errors
    /// [`FileError`], naming file and field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        read_json(path.as_ref())
    }

    /// Writes `diagnosis.json`.
    ///
    /// # Errors
    /// [`FileError`], naming the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        write_json(path.as_ref(), self)
    }
}
