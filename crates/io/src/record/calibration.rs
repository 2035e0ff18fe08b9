//! `calibration.json`: a calibrated depth camera, its uncertainty, and the data that it was fitted to.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use depthcal_model::hook::HookKind;
use depthcal_model::{FormulaDefinition, Of, On, Target};
use serde::{Deserialize, Serialize};

use super::lens_comparison::LensComparison;
use super::prior::PriorUse;
use super::reference::FileReference;
use crate::dataset::FrameMetadata;
use crate::file::{Fault, FileError, Versioned, read_versioned, write_versioned};

/// A calibrated depth camera: its pieces in chain order, their covariance, the noise model, and the fit.
///
/// The file carries `"format": "depthcal-calibration"` and `"version": 2` in addition to these fields. Files of version 1 have no formulas
/// and are read as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Calibration {
    /// The camera.
    pub camera: CameraRecord,
    /// Covariance of the free parameters, where the estimator gives one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<CovarianceRecord>,
    /// Noise of the measurements, estimated from the data.
    pub noise: NoiseRecord,
    /// Quality and course of the fit.
    pub fit: FitRecord,
    /// The frames that were fitted, with their poses.
    pub frames: Vec<FrameRecord>,
    /// The dataset that was fitted.
    pub dataset: FileReference,
    /// Millimetres per step of the dataset's depth images, where it had any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_unit_mm: Option<f64>,
    /// The board.
    pub target: Target,
    /// The observations that were fitted, where they were kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observations: Option<FileReference>,
}

/// The camera as a chain of pieces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CameraRecord {
    /// Width of the image in px.
    pub width: usize,
    /// Height of the image in px.
    pub height: usize,
    /// The pieces in the order in which they are applied. Names are unique.
    pub pieces: Vec<PieceRecord>,
}

/// One piece of the chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PieceRecord {
    /// The stage of the chain at which it acts.
    pub hook: HookKind,
    /// Its registered name, such as `brown_conrady` or `projective`.
    pub name: String,
    /// Its parameters, in its own order. Names are unique within the piece.
    pub parameters: Vec<ParameterRecord>,
    /// For an effect of depth, the state from which it takes its covariates; the true one where absent.
    #[serde(default, skip_serializing_if = "is_default")]
    pub of: Of,
    /// For an effect of depth, what its shape is added to; as in its own equation where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on: Option<On>,
    /// Settings that are not estimated, such as the number of cells of a grid.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, f64>,
    /// The definition of a piece that is given as a formula, so that the file needs no other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<FormulaDefinition>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// One parameter of a piece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ParameterRecord {
    /// Name within the piece, such as `k1`.
    pub name: String,
    /// Unit, such as `px` or `1/mm`; `1` for a dimensionless parameter.
    pub unit: String,
    /// Estimate, in `unit`.
    pub value: f64,
    /// Standard deviation, in `unit`; absent where the parameter was not estimated or the data do not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<f64>,
    /// Whether the value was held constant.
    pub fixed: bool,
}

/// Covariance of the free parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CovarianceRecord {
    /// Names of rows and columns, `piece.parameter`.
    pub parameters: Vec<String>,
    /// Symmetric matrix, one row and column for each of `parameters`, in products of the parameters' units.
    pub matrix: Vec<Vec<f64>>,
}

/// Noise of the measurements.
///
/// The noise of depth is a standard deviation in inverse depth, σ_ρ² = a² + (b ρ²)²: `a` is constant in inverse depth
/// (structured light, stereo), `b` constant in depth (time of flight).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct NoiseRecord {
    /// Standard deviation of a marker's coordinate, px.
    pub pixel_sigma: f64,
    /// a of the depth noise, 1/mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inverse_depth_sigma_a: Option<f64>,
    /// b of the depth noise, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inverse_depth_sigma_b: Option<f64>,
    /// Distance from which the noise of two depth pixels is uncorrelated, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlation_length_px: Option<f64>,
    /// Further parameters of the noise model, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub other: BTreeMap<String, f64>,
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

impl Calibration {
    /// Reads a calibration.
    ///
    /// # Errors
    /// [`FileError`] with file and field: another format or version, a missing field, a number out of its range.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        read_versioned(path.as_ref())
    }

    /// Writes the calibration atomically; every number reads back with the same bits.
    ///
    /// # Errors
    /// [`FileError::NotFinite`] or [`FileError::Invalid`] with the field, [`FileError::Write`]; nothing is written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        write_versioned(path.as_ref(), self, false)
    }

    /// The piece called `name`.
    pub fn piece(&self, name: &str) -> Option<&PieceRecord> {
        self.camera.piece(name)
    }

    /// The pieces that act at `hook`, in chain order.
    pub fn pieces_at(&self, hook: HookKind) -> impl Iterator<Item = &PieceRecord> {
        self.camera.pieces.iter().filter(move |piece| piece.hook == hook)
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

impl CameraRecord {
    /// The piece called `name`.
    pub fn piece(&self, name: &str) -> Option<&PieceRecord> {
        self.pieces.iter().find(|piece| piece.name == name)
    }
}

impl PieceRecord {
    /// The parameter called `name`.
    pub fn parameter(&self, name: &str) -> Option<&ParameterRecord> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// Value of the parameter called `name`.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.parameter(name).map(|parameter| parameter.value)
    }

    /// Values of all parameters, in order.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.value).collect()
    }
}

impl NoiseRecord {
    /// Standard deviation of inverse depth, 1/mm, at inverse depth `rho`, 1/mm; `None` where there is no depth noise.
    pub fn inverse_depth_sigma(&self, rho: f64) -> Option<f64> {
        match (self.inverse_depth_sigma_a, self.inverse_depth_sigma_b) {
            (None, None) => None,
            (a, b) => Some(a.unwrap_or(0.0).hypot(b.unwrap_or(0.0) * rho * rho)),
        }
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

impl CameraRecord {
    fn check(&self) -> Result<(), Fault> {
        for (field, size) in [("camera.width", self.width), ("camera.height", self.height)] {
            if size == 0 {
                return Err(Fault::new(field, "is 0, expected the size of the image in px"));
            }
        }
        unique(self.pieces.iter().map(|piece| &piece.name), "camera.pieces")?;
        for (i, piece) in self.pieces.iter().enumerate() {
            let field = format!("camera.pieces[{i}].parameters");
            unique(piece.parameters.iter().map(|parameter| &parameter.name), &field)?;
            for (j, parameter) in piece.parameters.iter().enumerate() {
                if parameter.std_dev.is_some_and(|sigma| sigma < 0.0) {
                    return Err(Fault::new(format!("{field}[{j}].std_dev"), "must not be negative"));
                }
            }
        }
        Ok(())
    }
}

impl Versioned for Calibration {
    const FORMAT: &'static str = "depthcal-calibration";
    const VERSION: u32 = 2;
    const OLDEST: u32 = 1;

    fn check(&self) -> Result<(), Fault> {
        self.camera.check()?;
        if let Some(covariance) = &self.covariance {
            covariance.check()?;
        }
        let noise = &self.noise;
        for (field, sigma) in [
            ("noise.pixel_sigma", Some(noise.pixel_sigma)),
            ("noise.inverse_depth_sigma_a", noise.inverse_depth_sigma_a),
            ("noise.inverse_depth_sigma_b", noise.inverse_depth_sigma_b),
            ("noise.correlation_length_px", noise.correlation_length_px),
        ] {
            if sigma.is_some_and(|sigma| sigma < 0.0) {
                return Err(Fault::new(field, "must not be negative"));
            }
        }
        if self.depth_unit_mm.is_some_and(|unit| unit <= 0.0) {
            return Err(Fault::new("depth_unit_mm", "must be above 0: millimetres per step of the depth images"));
        }
        unique(self.frames.iter().map(|frame| &frame.name), "frames")?;
        for (i, frame) in self.frames.iter().enumerate() {
            let norm = frame.rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-6 {
                let problem = format!("has norm {norm}, expected a unit quaternion [w, x, y, z]");
                return Err(Fault::new(format!("frames[{i}].rotation"), problem));
            }
        }
        Ok(())
    }
}

fn unique<'a>(names: impl IntoIterator<Item = &'a String>, field: &str) -> Result<(), Fault> {
    let mut seen = BTreeSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(Fault::new(field, format!("has the name \"{name}\" more than once"))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::example;
