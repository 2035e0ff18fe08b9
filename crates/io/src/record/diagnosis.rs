//! `diagnosis.json`: what a model lacked, what was added, and the error before and after.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{FileError, FileReference, Interval, read_json, write_json};

/// The outcome of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Nothing was missing that the data can show.
    Adequate,
    /// Named effects were added, and nothing is left that the data can show.
    Effect,
    /// Something is left, or only a free map takes it up.
    Unexplained,
}

/// Errors of one model on frames that it was not fitted to; one number each, absent where there is no depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct HeldOutErrors {
    /// Mean distance between markers from image and depth and their places on the board, mm.
    pub dot_error_mm: Option<f64>,
    /// Mean absolute height of depth pixels over the board, mm.
    pub plane_error_mm: Option<f64>,
    /// Root mean square of depth minus the board's depth, mm.
    pub depth_rms_mm: Option<f64>,
    /// Root mean square reprojection error, px.
    pub reprojection_px: f64,
}

/// A difference with its 95 % interval, from resampled frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GainInterval {
    /// Estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl GainInterval {
    /// Whether there is a gain beyond chance: the whole interval is above zero.
    pub fn is_certain(&self) -> bool {
        self.low > 0.0
    }
}

/// An effect that was accepted and added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisStep {
    /// Names in the order of their gain: the first is the one that was added.
    pub effects: Vec<String>,
    /// Effects that these captures cannot tell from it.
    pub indistinguishable: Vec<String>,
    /// As given to `calibrate --with`, constants included.
    pub with: String,
    /// Its parameters.
    pub parameters: Vec<DiagnosisParameter>,
    /// Root mean square size of the effect over the observations, mm.
    pub size_mm: f64,
    /// p-value of the score test, corrected for the number of effects that were tested.
    pub p_value: f64,
    /// Errors before it was added.
    pub before: HeldOutErrors,
    /// Errors after.
    pub after: HeldOutErrors,
    /// Root mean square depth error after it was added, with its interval; absent where there is none, and in files of
    /// earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_after_mm: Option<Interval>,
    /// Fall of the root mean square depth error, per cent.
    pub depth_gain_percent: Option<GainInterval>,
}

/// A fitted parameter of an added effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisParameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Standard deviation; absent where it is not estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
}

/// What the last round found about an effect that is not in the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisCandidate {
    /// Its name.
    pub effect: String,
    /// p-value of the score test, corrected for the constants that were tried.
    pub p_value: f64,
    /// Size that the data would give it, mm; absent where these captures say nothing about it.
    pub expected_size_mm: Option<f64>,
    /// Smallest size that these captures would have shown, mm; absent where they show none.
    pub minimal_detectable_mm: Option<f64>,
    /// Fall of the weighted root mean square residual on left-out frames, per cent; negative where the effect does harm.
    pub held_out_gain_percent: f64,
}

/// What one round found beside the model that it started from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisRound {
    /// Effects, by falling gain.
    pub effects: Vec<DiagnosisCandidate>,
    /// Free functions of a covariate, by falling gain: competitors of the effects, no names.
    pub free: Vec<DiagnosisCandidate>,
    /// What was decided, in words.
    pub decision: String,
}

/// A frame that was left out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosisFrame {
    /// Its name.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// How a frame's depth, as a whole, deviates from the pose that its image shows, beside the last model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisFramePlane {
    /// The frame.
    pub name: String,
    /// Offset in the middle of the board, mm.
    pub offset_mm: f64,
    /// Root mean square over the frame's depth samples, mm.
    pub rms_mm: f64,
    /// p-value of the plane against noise.
    pub p_value: f64,
}

/// How well effects can pass for each other on these captures, beside the declared model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Separability {
    /// The effects, those that were added first.
    pub effects: Vec<String>,
    /// Row i, column k: cosine of the angle between effect i, at the parameters that the data give it and as far as the
    /// declared model leaves it, and everything that effect k can do. 1: k can pass for i; 0: nothing in common.
    pub mimicry: Vec<Vec<f64>>,
}

/// First and last model on frames that they were not fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisHeldOut {
    /// The declared model.
    pub before: HeldOutErrors,
    /// The last model.
    pub after: HeldOutErrors,
}

/// Result of `depthcal diagnose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisFile {
    /// The dataset.
    pub dataset: FileReference,
    /// Depth model that was declared.
    pub model: String,
    /// The outcome.
    pub verdict: Verdict,
    /// What was accepted and added, in order.
    pub steps: Vec<DiagnosisStep>,
    /// Every effect that was tested beside the declared model, and the free map, by falling gain.
    pub candidates: Vec<DiagnosisCandidate>,
    /// The same for every round, with all free functions.
    #[serde(default)]
    pub rounds: Vec<DiagnosisRound>,
    /// Frames that were left out.
    pub bad_frames: Vec<DiagnosisFrame>,
    /// Declarations that look wrong, in words.
    #[serde(default)]
    pub declarations: Vec<String>,
    /// What is left, in words.
    #[serde(default)]
    pub left_over: Vec<String>,
    /// What to capture next, in words.
    #[serde(default)]
    pub capture_next: Vec<String>,
    /// Every frame's own plane beside the last model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frame_planes: Vec<DiagnosisFramePlane>,
    /// Which effects these captures can tell apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separability: Option<Separability>,
    /// First model against last.
    pub held_out: DiagnosisHeldOut,
}

impl DiagnosisFile {
    /// Reads `diagnosis.json`.
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
