//! One camera of a rig in `calibration.json`.

use serde::{Deserialize, Serialize};

use super::camera::{CameraRecord, NoiseRecord, PieceRecord, check_pieces, check_size, unit_quaternion};
use crate::file::Fault;

/// A camera of a rig: its chain of pieces, its place on the rig, and how it was fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct RigCameraRecord {
    /// The camera's name.
    pub name: String,
    /// Width of its images in px.
    pub width: usize,
    /// Height of its images in px.
    pub height: usize,
    /// Its place: maps the frame of the rig, which is that of the first camera, to its own.
    pub camera_from_rig: PlaceRecord,
    /// By how much it exposes later than the times of its frames say, against the reference; absent where that was not estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_offset: Option<TimeOffsetRecord>,
    /// The pieces in the order in which they are applied. Names are unique.
    pub pieces: Vec<PieceRecord>,
    /// Noise of its measurements, estimated from the data.
    pub noise: NoiseRecord,
    /// Millimetres per step of its depth images, where it has any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_unit_mm: Option<f64>,
    /// Number of its frames in the fit.
    pub frames_used: usize,
    /// Root mean square, over all its markers, of the length of the reprojection error, px; absent without images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reprojection_rms_px: Option<f64>,
    /// Root mean square of its depth residuals, mm; absent without depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<f64>,
    /// Parameters, `PIECE.PARAMETER`, that the boards leave open and that are therefore held or have a prior, each with the
    /// reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_open: Vec<LeftOpen>,
}

/// Where a camera sits on its rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PlaceRecord {
    /// Rotation, rig to camera, as a unit quaternion [w, x, y, z].
    pub rotation: [f64; 4],
    /// Translation, rig to camera, mm.
    pub translation_mm: [f64; 3],
    /// Standard deviations; absent for the reference, whose place is exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<PlaceStdDev>,
    /// How the place changes; absent where it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<DriftRecord>,
}

/// The covariate of a drift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub enum DriftOver {
    /// The frames' `timestamp_s`.
    #[serde(rename = "timestamp_s")]
    Time,
    /// The frames' `temperature_c`.
    #[serde(rename = "temperature_c")]
    Temperature,
}

/// A place (R, t) that changes in proportion to time or temperature x: (R Exp(s ω), t + s τ) with s = (x − `reference`) /
/// `range`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DriftRecord {
    /// x.
    pub over: DriftOver,
    /// Value of x at which the camera has its place, s or °C.
    pub reference: f64,
    /// Range of x over which the place changes by the rotation and the translation here, s or °C.
    pub range: f64,
    /// ω: about the axes of the rig, rad.
    pub rotation_rad: [f64; 3],
    /// τ: along the axes of the camera, mm.
    pub translation_mm: [f64; 3],
    /// Standard deviations of ω and τ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<PlaceStdDev>,
}

/// Standard deviations of a place: of the rotation vector ω and of τ in R Exp(ω), t + τ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PlaceStdDev {
    /// About the axes of the rig, rad.
    pub rotation_rad: [f64; 3],
    /// Along the axes of the camera, mm.
    pub translation_mm: [f64; 3],
}

/// By how much a camera exposes later than the times of its frames say.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TimeOffsetRecord {
    /// The offset, s.
    pub value_s: f64,
    /// Its standard deviation, s.
    pub std_dev_s: f64,
}

/// A parameter that the boards leave open.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct LeftOpen {
    /// The parameter, `PIECE.PARAMETER`.
    pub parameter: String,
    /// Why, and what was done about it, in words.
    pub reason: String,
}

impl RigCameraRecord {
    /// The camera alone.
    pub fn camera(&self) -> CameraRecord {
        CameraRecord { width: self.width, height: self.height, pieces: self.pieces.clone() }
    }

    /// Checks the camera with this place in the list.
    pub(super) fn check(&self, place: usize) -> Result<(), Fault> {
        check_size([self.width, self.height], &format!("cameras[{place}]"))?;
        unit_quaternion(&self.camera_from_rig.rotation, || format!("cameras[{place}].camera_from_rig.rotation"))?;
        self.noise.check(&format!("cameras[{place}].noise"))?;
        check_pieces(&self.pieces, &format!("cameras[{place}].pieces"))
    }
}
