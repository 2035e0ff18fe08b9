//! Between calibrations in memory and `calibration.json`.

use std::collections::BTreeMap;
use std::sync::Arc;

use depthcal_formula::{FormulaEffect, FormulaError};
use depthcal_io::{
    Calibration, CameraRecord, CovarianceRecord, DiagnosisDeclaration, FileReference, FitRecord, FrameRecord,
    NoiseRecord, ParameterRecord, PieceRecord, PriorUse, UsedPriorParameter,
};
use depthcal_model::{AnyPiece, Block, Camera, FormulaDefinition, Options, Placement, Register, RegisterError};
use depthcal_statistics::chi_squared_tail;
use nalgebra::DVector;
use thiserror::Error;

pub use crate::calibrate::parameter_names;
use crate::calibrate::{Calibrated, ImplausibleScale, PLAUSIBLE_SCALE_DEVIATION, implausible_scale};
use crate::judge::evaluate::Evaluated;

/// Why a calibration file does not make a camera.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RecordError {
    /// A piece is not known here.
    #[error(transparent)]
    Register(#[from] RegisterError),
    /// A piece has other parameters here.
    #[error(
        "piece '{piece}' of the calibration has the parameters {found}, but this version expects {expected}: \
             calibrate again"
    )]
    Parameters {
        /// The piece.
        piece: String,
        /// Names in the file.
        found: String,
        /// Names expected.
        expected: String,
    },
    /// The formula of a piece is at fault.
    #[error(transparent)]
    Formula(#[from] FormulaError),
    /// There is no pinhole.
    #[error("the calibration has no piece 'pinhole'")]
    NoPinhole,
}

/// The file's content for a calibration.
///
/// `fitted` is the evaluation of the frames that were fitted; it gives the errors of each frame.
pub fn calibration_record(
    result: &Calibrated,
    fitted: &Evaluated,
    dataset: FileReference,
    observations: Option<FileReference>,
) -> Calibration {
    let camera = &result.camera;
    let pieces = piece_records(camera, &result.std_devs());
    let names: Vec<(String, bool)> = parameter_names(camera);
    let covariance = result.covariance.as_ref().map(|c| {
        let free: Vec<usize> = (0..names.len()).filter(|i| names[*i].1 && c[(*i, *i)] > 0.0).collect();
        CovarianceRecord {
            parameters: free.iter().map(|i| names[*i].0.clone()).collect(),
            matrix: free.iter().map(|i| free.iter().map(|j| c[(*i, *j)]).collect()).collect(),
        }
    });
    Calibration {
        camera: CameraRecord {
            noise: noise_record(result),
            depth_unit_mm: result.capture.depth_unit_mm,
            frames_used: result.capture.frames.len(),
            reprojection_rms_px: Some(result.reprojection_rms_px),
            depth_rms_mm: result.depth_rms_mm,
            ..CameraRecord::unnamed([camera.width, camera.height], pieces)
        },
        others: Vec::new(),
        covariance,
        fit: FitRecord {
            estimator: result.estimator.name().to_owned(),
            model: result.model.to_string(),
            lens_comparison: result.lens_comparison.clone(),
            prior: prior_use(result),
            reprojection_rms_px: result.reprojection_rms_px,
            depth_rms_mm: result.depth_rms_mm,
            frames_used: result.capture.frames.len(),
            frames_dropped: result.capture.dropped.clone(),
            declarations: declarations(result),
            termination: result.termination.clone(),
            cost: result.cost,
            iterations: result.iterations,
        },
        frames: frame_records(result, fitted),
        dataset,
        target: result.capture.target.clone(),
        observations,
    }
}

/// Declarations of a fit's dataset that cannot be right.
pub fn declarations(result: &Calibrated) -> Vec<DiagnosisDeclaration> {
    implausible_scale(&result.capture, PLAUSIBLE_SCALE_DEVIATION).iter().map(ImplausibleScale::record).collect()
}

/// How a fit used its prior; `None` where it has none, or none that concerns its parameters.
pub fn prior_use(result: &Calibrated) -> Option<PriorUse> {
    let prior = result.prior.as_ref()?;
    let part = prior.of(&result.camera)?;
    let (theta, stds) = (result.camera.theta(), result.std_devs());
    let deviation = DVector::from_fn(part.places.len(), |i, _| theta[part.places[i]] - part.mean[i]);
    let distance_squared = (&part.whitening * deviation).norm_squared();
    let parameter = |(i, at): (usize, &usize)| {
        let variance = part.covariance[(i, i)];
        UsedPriorParameter {
            name: part.names[i].clone(),
            mean: part.mean[i],
            std_dev: variance.sqrt(),
            own_share: stds[*at].map_or(0.0, |std| (1.0 - std * std / variance).clamp(0.0, 1.0)),
        }
    };
    Some(PriorUse {
        units: prior.units,
        parameters: part.places.iter().enumerate().map(parameter).collect(),
        distance_squared,
        p_value: chi_squared_tail(distance_squared, part.places.len()),
    })
}

/// The noise of a calibration, for its file.
pub fn noise_record(result: &Calibrated) -> NoiseRecord {
    let mut other = BTreeMap::new();
    other.insert("depth_outliers".to_owned(), result.outliers as f64);
    if result.noise.planes.of_noise > 0.0 {
        other.insert("frame_planes_of_noise".to_owned(), result.noise.planes.of_noise);
        let names = ["constant", "u", "v", "inverse_amplitude"];
        let deviations = names.iter().zip(result.noise.planes.deviations).filter(|(_, deviation)| *deviation > 0.0);
        other.extend(deviations.map(|(name, deviation)| (format!("frame_scatter_of_noise.{name}"), deviation)));
    }
    for field in &result.smoothness.fields {
        let mut note =
            |what: &str, value: f64| _ = other.insert(format!("{}.{}.{what}", field.piece, field.field), value);
        note("roughness", field.roughness);
        note("untouched_nodes", field.untouched as f64);
        field.effective.into_iter().for_each(|e| note("effective_parameters", e));
    }
    let depth = result.with_depth.then_some(result.noise.depth);
    NoiseRecord {
        pixel_sigma: result.noise.pixel_sigma,
        inverse_depth_sigma_a: depth.map(|d| d.a_per_mm),
        inverse_depth_sigma_b: depth.map(|d| d.b_mm),
        correlation_length_px: result.correlation_length_px.map(|c| c as f64),
        other,
    }
}

/// The pieces of a camera for a file, with the standard deviation of every parameter in the order of [`Camera::theta`].
pub fn piece_records(camera: &Camera, std_devs: &[Option<f64>]) -> Vec<PieceRecord> {
    let piece = |(block, range): (&Block, std::ops::Range<usize>)| PieceRecord {
        hook: block.hook(),
        name: block.name().to_owned(),
        parameters: block
            .parameters()
            .iter()
            .zip(&block.theta)
            .zip(&block.free)
            .zip(&std_devs[range])
            .map(|(((parameter, value), free), std_dev)| ParameterRecord {
                name: parameter.name.to_string(),
                unit: parameter.unit.to_owned(),
                value: *value,
                std_dev: *std_dev,
                fixed: !free,
            })
            .collect(),
        of: block.placement().of,
        on: block.placement().on,
        options: block.piece().map(|p| p.options()).unwrap_or_default(),
        formula: block.piece().and_then(|p| p.formula().cloned()),
    };
    camera.blocks_with_ranges().map(piece).collect()
}

fn frame_records(result: &Calibrated, fitted: &Evaluated) -> Vec<FrameRecord> {
    let errors_of = |name: &str| fitted.frames.iter().find(|f| f.name == name).map(|f| f.record());
    result
        .capture
        .frames
        .iter()
        .map(|frame| {
            let pose = &frame.camera_from_board;
            let q = pose.rotation.quaternion();
            let t = pose.translation.vector;
            let errors = errors_of(&frame.name);
            FrameRecord {
                name: frame.name.clone(),
                rotation: [q.w, q.i, q.j, q.k],
                translation_mm: [t.x, t.y, t.z],
                reprojection_rms_px: errors.as_ref().map_or(0.0, |e| e.reprojection_px.rms),
                depth_rms_mm: errors.and_then(|e| e.depth_rms_mm).map(|d| d.after),
                metadata: frame.metadata.clone(),
            }
        })
        .collect()
}

/// The camera of a calibration file.
///
/// # Errors
///
/// [`RecordError`], where a piece is unknown or has other parameters than this register's.
pub fn camera_from_record(record: &CameraRecord, register: &Register) -> Result<Camera, RecordError> {
    let mut pinhole = None;
    let mut blocks = Vec::new();
    for piece in &record.pieces {
        let mut block = if piece.name == "pinhole" {
            Block::pinhole([0.0; 5])
        } else {
            let placement = Placement { of: piece.of, on: piece.on };
            match &piece.formula {
                Some(definition) => Block::new(formula_piece(definition, &piece.options, placement)?),
                None => Block::new(register.placed_piece(&piece.name, &piece.options, placement)?),
            }
        };
        let names: Vec<&str> = piece.parameters.iter().map(|p| p.name.as_str()).collect();
        let expected: Vec<&str> = block.parameters().iter().map(|p| &*p.name).collect();
        if names != expected {
            let (names, expected) = (names.join(", "), expected.join(", "));
            return Err(RecordError::Parameters { piece: piece.name.clone(), found: names, expected });
        }
        block.theta = piece.parameters.iter().map(|p| p.value).collect();
        block.free = piece.parameters.iter().map(|p| !p.fixed).collect();
        if piece.name == "pinhole" {
            pinhole = Some(block);
        } else {
            blocks.push(block);
        }
    }
    let pinhole = pinhole.ok_or(RecordError::NoPinhole)?;
    Ok(Camera::from_blocks(record.width, record.height, pinhole, blocks))
}

/// The piece of a formula that a file carries, whatever the register has.
fn formula_piece(
    definition: &FormulaDefinition,
    options: &Options,
    placement: Placement,
) -> Result<Arc<dyn AnyPiece>, RecordError> {
    let mut register = Register::empty();
    FormulaEffect::new(definition.clone())?.register(&mut register)?;
    Ok(register.placed_piece(&definition.name, options, placement)?)
}
