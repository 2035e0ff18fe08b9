//! Cameras in result files: pieces with their parameters, and the noise of their measurements.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_model::hook::HookKind;
use depthcal_model::{FormulaDefinition, Of, On};
use serde::{Deserialize, Serialize};

use super::extrinsics::{ExtrinsicsRecord, TimeOffsetRecord};
use super::options::{self, OptionValue};
use crate::dataset::CAMERA;
use crate::file::Fault;
use crate::image::{Disparity, MAX_PIXELS};

/// A camera: its chain of pieces, its extrinsics, and how it was fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CameraRecord {
    /// The camera's name; `camera` where the dataset names none.
    pub name: String,
    /// Width of its images in px.
    pub width: usize,
    /// Height of its images in px.
    pub height: usize,
    /// Its extrinsics: maps the frame of the rig, which is that of the first camera, to its own.
    pub camera_from_rig: ExtrinsicsRecord,
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
    /// a and b of 1/z = a + b d, 1/mm, where its files hold disparities d in place of depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity: Option<Disparity>,
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

/// A parameter that the boards leave open.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct LeftOpen {
    /// The parameter, `PIECE.PARAMETER`.
    pub parameter: String,
    /// Why, and what was done about it, in words.
    pub reason: String,
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
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", with = "options")]
    #[schemars(with = "BTreeMap<String, OptionValue>")]
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

impl CameraRecord {
    /// A camera without a name and noise: its size, px, and its pieces.
    pub fn unnamed([width, height]: [usize; 2], pieces: Vec<PieceRecord>) -> Self {
        Self {
            name: CAMERA.to_owned(),
            width,
            height,
            camera_from_rig: ExtrinsicsRecord::REFERENCE,
            time_offset: None,
            pieces,
            noise: NoiseRecord::default(),
            depth_unit_mm: None,
            disparity: None,
            frames_used: 0,
            reprojection_rms_px: None,
            depth_rms_mm: None,
            left_open: Vec::new(),
        }
    }

    /// Whether its dataset gave it no name.
    pub fn is_unnamed(&self) -> bool {
        self.name == CAMERA
    }

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
}

impl NoiseRecord {
    /// Checks the noise that the file has at `place`.
    pub(super) fn check(&self, place: &str) -> Result<(), Fault> {
        for (field, sigma) in [
            ("pixel_sigma", Some(self.pixel_sigma)),
            ("inverse_depth_sigma_a", self.inverse_depth_sigma_a),
            ("inverse_depth_sigma_b", self.inverse_depth_sigma_b),
            ("correlation_length_px", self.correlation_length_px),
        ] {
            if sigma.is_some_and(|sigma| sigma < 0.0) {
                return Err(Fault::new(format!("{place}.{field}"), "must not be negative"));
            }
        }
        Ok(())
    }
}

impl CameraRecord {
    /// Checks the camera that the file has at `place`, and its noise at `noise`.
    pub(super) fn check(&self, place: &str, noise: &str) -> Result<(), Fault> {
        check_size([self.width, self.height], place)?;
        self.camera_from_rig.check(&format!("{place}.camera_from_rig"))?;
        self.noise.check(noise)?;
        check_pieces(&self.pieces, &format!("{place}.pieces"))
    }
}

/// Checks the width and the height, px, of the camera that the file has at `place`: corrections have tables of this size.
fn check_size([width, height]: [usize; 2], place: &str) -> Result<(), Fault> {
    for (field, size) in [("width", width), ("height", height)] {
        if size == 0 {
            return Err(Fault::new(format!("{place}.{field}"), "is 0, expected the size of the image in px"));
        }
    }
    if width.checked_mul(height).is_none_or(|pixels| pixels > MAX_PIXELS) {
        let problem = format!("is {width}, and the height {height}: no image of more than {MAX_PIXELS} px is read");
        return Err(Fault::new(format!("{place}.width"), problem));
    }
    Ok(())
}

/// Checks the pieces that the file has at `place`.
fn check_pieces(pieces: &[PieceRecord], place: &str) -> Result<(), Fault> {
    unique(pieces.iter().map(|piece| &piece.name), place)?;
    for (i, piece) in pieces.iter().enumerate() {
        let field = format!("{place}[{i}].parameters");
        unique(piece.parameters.iter().map(|parameter| &parameter.name), &field)?;
        for (j, parameter) in piece.parameters.iter().enumerate() {
            if parameter.std_dev.is_some_and(|sigma| sigma < 0.0) {
                return Err(Fault::new(format!("{field}[{j}].std_dev"), "must not be negative"));
            }
        }
    }
    Ok(())
}

pub(super) fn unique<'a>(names: impl IntoIterator<Item = &'a String>, field: &str) -> Result<(), Fault> {
    let mut seen = BTreeSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(Fault::new(field, format!("has the name \"{name}\" more than once"))),
        None => Ok(()),
    }
}
