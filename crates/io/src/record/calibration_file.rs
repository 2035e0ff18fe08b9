//! The fields of `calibration.json`: a short form for one camera without a name, and a list of cameras.

use std::borrow::Cow;

use depthcal_model::Target;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::calibration::{Calibration, CovarianceRecord, FitRecord, FrameRecord};
use super::camera::{CameraRecord, NoiseRecord, PieceRecord};
use super::reference::FileReference;
use crate::image::Disparity;

/// A calibrated depth camera: its pieces in chain order, their covariance, the noise model, and the fit.
///
/// The file carries `"format": "depthcal-calibration"` and `"version": 2` in addition to these fields; that of a rig has version
/// 3. Files of version 1 have no formulas and are read as well.
#[derive(Serialize, Deserialize, schemars::JsonSchema)]
#[schemars(rename = "Calibration")]
struct CalibrationFile {
    /// The camera; of a rig the reference.
    camera: Chain,
    /// Covariance of the free parameters, where the estimator gives one. Of a rig they are all cameras' with their places, and
    /// names begin with the camera's, `colour/pinhole.fx`, `colour/camera_from_rig.rx`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    covariance: Option<CovarianceRecord>,
    /// Noise of the measurements, estimated from the data.
    noise: NoiseRecord,
    /// Quality and course of the fit.
    fit: FitRecord,
    /// The frames that were fitted, with their poses.
    frames: Vec<FrameRecord>,
    /// The dataset that was fitted.
    dataset: FileReference,
    /// Millimetres per step of the dataset's depth images, where it had any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    depth_unit_mm: Option<f64>,
    /// a and b of 1/z = a + b d, 1/mm, where the dataset's files hold disparities d in place of depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    disparity: Option<Disparity>,
    /// The board.
    target: Target,
    /// The observations that were fitted, where they were kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    observations: Option<FileReference>,
    /// The cameras of a rig, the reference first; empty for one camera.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    cameras: Vec<CameraRecord>,
}

/// The camera as a chain of pieces.
#[derive(Serialize, Deserialize, schemars::JsonSchema)]
struct Chain {
    /// Width of the image in px.
    width: usize,
    /// Height of the image in px.
    height: usize,
    /// The pieces in the order in which they are applied. Names are unique.
    pieces: Vec<PieceRecord>,
}

impl From<CalibrationFile> for Calibration {
    fn from(file: CalibrationFile) -> Self {
        let CalibrationFile {
            camera,
            covariance,
            noise,
            fit,
            frames,
            dataset,
            depth_unit_mm,
            disparity,
            target,
            observations,
            cameras,
        } = file;
        let mut cameras = cameras.into_iter();
        let camera = cameras.next().unwrap_or_else(|| CameraRecord {
            noise,
            depth_unit_mm,
            disparity,
            frames_used: fit.frames_used,
            reprojection_rms_px: Some(fit.reprojection_rms_px),
            depth_rms_mm: fit.depth_rms_mm,
            ..CameraRecord::unnamed([camera.width, camera.height], camera.pieces)
        });
        Self { camera, others: cameras.collect(), covariance, fit, frames, dataset, target, observations }
    }
}

impl From<&Calibration> for CalibrationFile {
    fn from(calibration: &Calibration) -> Self {
        let cameras = if calibration.is_short() { Vec::new() } else { calibration.cameras().cloned().collect() };
        let Calibration { camera, covariance, fit, frames, dataset, target, observations, .. } = calibration.clone();
        let CameraRecord { width, height, pieces, noise, depth_unit_mm, disparity, .. } = camera;
        let camera = Chain { width, height, pieces };
        Self {
            camera,
            covariance,
            noise,
            fit,
            frames,
            dataset,
            depth_unit_mm,
            disparity,
            target,
            observations,
            cameras,
        }
    }
}

impl Serialize for Calibration {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        CalibrationFile::from(self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Calibration {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        CalibrationFile::deserialize(deserializer).map(Self::from)
    }
}

impl JsonSchema for Calibration {
    fn schema_name() -> Cow<'static, str> {
        CalibrationFile::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        CalibrationFile::json_schema(generator)
    }
}
