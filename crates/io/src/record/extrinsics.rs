//! Extrinsics of a camera in `calibration.json`, how they change, and when the camera exposes.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::file::Fault;

/// Extrinsics of a camera: where it sits on its rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ExtrinsicsRecord {
    /// Rotation, rig to camera, as a unit quaternion [w, x, y, z].
    pub rotation: [f64; 4],
    /// Translation, rig to camera, mm.
    pub translation_mm: [f64; 3],
    /// Standard deviations; absent for the reference and for declared extrinsics, which are exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<ExtrinsicsStdDev>,
    /// How they change; absent where they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<DriftRecord>,
}

/// The quantity that a drift depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub enum DriftOver {
    /// The frames' `timestamp_s`.
    #[serde(rename = "timestamp_s")]
    Time,
    /// The frames' `temperature_c`.
    #[serde(rename = "temperature_c")]
    Temperature,
}

/// Extrinsics (R, t) that change in proportion to time or temperature x: (R Exp(s ω), t + s τ) with s = (x − `reference`) /
/// `range`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DriftRecord {
    /// x.
    pub over: DriftOver,
    /// Value of x at which the camera has its extrinsics, s or °C.
    pub reference: f64,
    /// Range of x over which they change by the rotation and the translation here, s or °C.
    pub range: f64,
    /// ω: about the axes of the rig, rad.
    pub rotation_rad: [f64; 3],
    /// τ: along the axes of the camera, mm.
    pub translation_mm: [f64; 3],
    /// Standard deviations of ω and τ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<ExtrinsicsStdDev>,
}

/// Standard deviations of extrinsics: of the rotation vector ω and of τ in R Exp(ω), t + τ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ExtrinsicsStdDev {
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
    /// Its standard deviation, s; absent where the covariance is out of reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev_s: Option<f64>,
}

/// The isometry of a unit quaternion [w, x, y, z] and a translation.
pub(super) fn isometry([w, x, y, z]: [f64; 4], translation: [f64; 3]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(translation)), rotation)
}

impl ExtrinsicsRecord {
    /// The extrinsics of the reference: the frame of the rig is its own.
    pub const REFERENCE: Self =
        Self { rotation: [1.0, 0.0, 0.0, 0.0], translation_mm: [0.0; 3], std_dev: None, drift: None };

    /// The extrinsics as an isometry: maps coordinates of the rig to those of the camera, mm.
    pub fn camera_from_rig(&self) -> Isometry3<f64> {
        isometry(self.rotation, self.translation_mm)
    }

    /// Checks the extrinsics that the file has at `place`.
    pub(super) fn check(&self, place: &str) -> Result<(), Fault> {
        unit_quaternion(&self.rotation, || format!("{place}.rotation"))
    }
}

/// Checks that the file has a unit quaternion in `field`.
pub(super) fn unit_quaternion(rotation: &[f64; 4], field: impl Fn() -> String) -> Result<(), Fault> {
    let norm = rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > 1e-6 {
        return Err(Fault::new(field(), format!("has norm {norm}, expected a unit quaternion [w, x, y, z]")));
    }
    Ok(())
}
