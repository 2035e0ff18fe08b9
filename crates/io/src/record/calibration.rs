//! `calibration.json`: a calibrated depth camera, its uncertainty, and the data that it was fitted to.

use std::io;
use std::path::Path;

use depthcal_model::Target;
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::board::check_board;
use super::camera::{CameraRecord, PieceRecord, unique};
use super::extrinsics::{isometry, unit_quaternion};
use super::findings::DiagnosisDeclaration;
use super::lens_comparison::LensComparison;
use super::prior::PriorUse;
use super::reference::FileReference;
use super::result_file::result_file;
use crate::dataset::FrameMetadata;
use crate::file::{Fault, FileError, Versioned, read_versioned, write_versioned};

/// A calibrated depth camera or rig of cameras: the pieces in chain order, their covariance, the noise models, and the fit.
///
/// The file of one camera without a name has it in the fields `camera`, `noise` and `depth_unit_mm`; that of a rig lists all in
/// `cameras`, and has the reference in those fields too. It carries `"format": "depthcal-calibration"` and `"version": 2`, that
/// of a rig 3. Files of version 1 have no formulas and are read as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The camera; of a rig the reference, whose frame is the rig's.
    pub camera: CameraRecord,
    /// The other cameras of a rig; empty for one camera.
    pub others: Vec<CameraRecord>,
    /// Covariance of the free parameters, where the estimator gives one. Of a rig they are all cameras' with their extrinsics,
    /// and names begin with the camera's, `colour/pinhole.fx`, `colour/camera_from_rig.rx`.
    pub covariance: Option<CovarianceRecord>,
    /// Quality and course of the fit.
    pub fit: FitRecord,
    /// The frames that were fitted, with their poses.
    pub frames: Vec<FrameRecord>,
    /// The dataset that was fitted.
    pub dataset: FileReference,
    /// The board.
    pub target: Target,
    /// The observations that were fitted, where they were kept.
    pub observations: Option<FileReference>,
}

result_file!(Calibration, "calibration.json", read_versioned, write_versioned);

/// Covariance of the free parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CovarianceRecord {
    /// Names of rows and columns, `piece.parameter`.
    pub parameters: Vec<String>,
    /// Symmetric matrix, one row and column for each of `parameters`, in products of the parameters' units.
    pub matrix: Vec<Vec<f64>>,
}

/// Quality and course of the fit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FitRecord {
    /// The estimator: `joint`, `linear`, `irls` or `nonlinear`.
    pub estimator: String,
    /// The depth model, as given to `--model`.
    pub model: String,
    /// The lens models that were compared, where the lens was to be chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens_comparison: Option<LensComparison>,
    /// The prior from other units of the camera's type, where one was used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorUse>,
    /// Root mean square, over all markers, of the length of the reprojection error, px.
    pub reprojection_rms_px: f64,
    /// Root mean square of the depth residuals, mm; absent without depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<f64>,
    /// Number of frames in the fit.
    pub frames_used: usize,
    /// Frames that were left out, with the reason.
    #[serde(default)]
    pub frames_dropped: Vec<DroppedFrame>,
    /// Declarations of the dataset that cannot be right.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub declarations: Vec<DiagnosisDeclaration>,
    /// Why the solver stopped.
    pub termination: String,
    /// Final cost, ½ Σ of the weighted squares under the loss.
    pub cost: f64,
    /// Iterations of the solver.
    pub iterations: usize,
}

/// A frame that was not fitted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DroppedFrame {
    /// Name of the frame.
    pub name: String,
    /// Reason, in words.
    pub reason: String,
}

/// A fitted frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameRecord {
    /// Name of the frame: the stem of its files.
    pub name: String,
    /// Rotation of the pose, board to camera, as a unit quaternion [w, x, y, z].
    pub rotation: [f64; 4],
    /// Translation of the pose, board to camera, mm.
    pub translation_mm: [f64; 3],
    /// Root mean square, over the frame's markers, of the length of the reprojection error, px.
    pub reprojection_rms_px: f64,
    /// Root mean square of the depth residuals in this frame, mm; absent without depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<f64>,
    /// The frame's row in the dataset's table.
    #[serde(default)]
    pub metadata: FrameMetadata,
}

impl FrameRecord {
    /// The pose: maps coordinates of the board to those of the rig, or of its only camera, mm.
    pub fn rig_from_board(&self) -> Isometry3<f64> {
        isometry(self.rotation, self.translation_mm)
    }
}

impl Calibration {
    /// Checks, before an evaluation is written into a folder, that the folder has no calibration other than the one that was
    /// evaluated: the evaluation and report of that one would be replaced, and the new ones be taken for its own. `evaluated` is
    /// `None` for a camera file of another program, and `name` is what the message calls the evaluated one.
    ///
    /// # Errors
    /// [`FileError::OtherCalibration`]; a `calibration.json` that cannot be read counts as another.
    pub fn check_no_other_in(folder: &Path, evaluated: Option<&Self>, name: &str) -> Result<(), FileError> {
        match Self::read(folder.join("calibration.json")) {
            Err(FileError::Read { error, .. }) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Ok(present) if evaluated.is_some_and(|evaluated| present.is_same_fit(evaluated)) => Ok(()),
            _ => Err(FileError::OtherCalibration { path: folder.to_owned(), evaluated: name.to_owned() }),
        }
    }

    /// Whether both are of the same fit, wherever its observations were kept: a calibration that was not saved yet refers to
    /// none.
    fn is_same_fit(&self, other: &Self) -> bool {
        let without_observations = |c: &Self| Self { observations: None, ..c.clone() };
        without_observations(self) == without_observations(other)
    }

    /// All cameras, the reference first.
    pub fn cameras(&self) -> impl Iterator<Item = &CameraRecord> {
        std::iter::once(&self.camera).chain(&self.others)
    }

    /// Whether it is of one camera without a name, and its file therefore of the short form.
    pub fn is_short(&self) -> bool {
        self.others.is_empty() && self.camera.is_unnamed()
    }

    /// The piece called `name`.
    pub fn piece(&self, name: &str) -> Option<&PieceRecord> {
        self.camera.piece(name)
    }

    /// Value of a parameter of the piece called `piece`.
    pub fn value(&self, piece: &str, parameter: &str) -> Option<f64> {
        self.piece(piece)?.value(parameter)
    }

    /// The frame called `name`.
    pub fn frame(&self, name: &str) -> Option<&FrameRecord> {
        self.frames.iter().find(|frame| frame.name == name)
    }
}

impl CovarianceRecord {
    /// Covariance of two parameters, each given as `piece.parameter`.
    pub fn get(&self, row: &str, column: &str) -> Option<f64> {
        let index = |name: &str| self.parameters.iter().position(|parameter| parameter == name);
        Some(*self.matrix.get(index(row)?)?.get(index(column)?)?)
    }

    fn check(&self) -> Result<(), Fault> {
        let n = self.parameters.len();
        if self.matrix.len() != n || self.matrix.iter().any(|row| row.len() != n) {
            return Err(Fault::new("covariance.matrix", format!("must be square with one row per parameter, {n}×{n}")));
        }
        for (i, row) in self.matrix.iter().enumerate() {
            if row[i] < 0.0 {
                return Err(Fault::new(
                    format!("covariance.matrix[{i}][{i}]"),
                    "is a variance and must not be negative",
                ));
            }
            for (j, value) in row.iter().enumerate().take(i) {
                let scale = (row[i] * self.matrix[j][j]).sqrt();
                // Tolerates rounding in the inverse of a badly conditioned matrix.
                if (value - self.matrix[j][i]).abs() > 1e-6 * scale.max(value.abs()) {
                    return Err(Fault::new(
                        format!("covariance.matrix[{i}][{j}]"),
                        "differs from its transposed element",
                    ));
                }
            }
        }
        unique(&self.parameters, "covariance.parameters")
    }
}

impl Versioned for Calibration {
    const FORMAT: &'static str = "depthcal-calibration";
    const VERSION: u32 = 3;
    const OLDEST: u32 = 1;

    /// Files of one camera are those of version 2.
    fn version(&self) -> u32 {
        if self.is_short() { 2 } else { 3 }
    }

    fn check(&self) -> Result<(), Fault> {
        check_board(&self.target, "target")?;
        if let Some(covariance) = &self.covariance {
            covariance.check()?;
        }
        unique(self.cameras().map(|camera| &camera.name), "cameras")?;
        for (i, camera) in self.cameras().enumerate() {
            let [place, within] = match self.is_short() {
                true => ["camera".to_owned(), String::new()],
                false => [format!("cameras[{i}]"), format!("cameras[{i}].")],
            };
            camera.check(&place, &format!("{within}noise"))?;
            if camera.depth_unit_mm.is_some_and(|unit| unit <= 0.0) {
                let problem = "must be above 0: millimetres per step of the depth images";
                return Err(Fault::new(format!("{within}depth_unit_mm"), problem));
            }
        }
        unique(self.frames.iter().map(|frame| &frame.name), "frames")?;
        for (i, frame) in self.frames.iter().enumerate() {
            unit_quaternion(&frame.rotation, || format!("frames[{i}].rotation"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::example;
