//! Between a camera in memory and its part of `calibration.json`.

use std::collections::BTreeMap;

use depthcal_formula::{FormulaEffect, FormulaError};
use depthcal_io::{
    CAMERA, Calibration, CameraRecord, DiagnosisDeclaration, DriftRecord, NoiseRecord, ParameterRecord, PieceRecord,
    PriorUse, UsedPriorParameter,
};
use depthcal_model::{Block, Camera, Placement, Register, RegisterError};
use depthcal_statistics::chi_squared_tail;
use nalgebra::{DMatrix, DVector, Isometry3};
use thiserror::Error;

use crate::calibrate::{
    CalibratedCamera, ImplausibleScale, PLAUSIBLE_SCALE_DEVIATION, implausible_scale, parameter_names,
};
use crate::observe::{PlaceDrift, PlacedCamera};

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

/// Declarations of a fit's dataset that cannot be right.
pub fn declarations(result: &CalibratedCamera) -> Vec<DiagnosisDeclaration> {
    implausible_scale(&result.capture, PLAUSIBLE_SCALE_DEVIATION).iter().map(ImplausibleScale::record).collect()
}

/// How a fit used its prior; `None` where it has none, or none that concerns its parameters.
pub fn prior_use(result: &CalibratedCamera) -> Option<PriorUse> {
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
pub fn noise_record(result: &CalibratedCamera) -> NoiseRecord {
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
                // Whatever the register has.
                Some(of_file) => {
                    Block::new(FormulaEffect::new(of_file.clone())?.placed_piece(&piece.options, placement)?)
                }
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

fn drift_of(record: &DriftRecord) -> PlaceDrift {
    let ([rx, ry, rz], [tx, ty, tz]) = (record.rotation_rad, record.translation_mm);
    let DriftRecord { over, reference, range, .. } = *record;
    PlaceDrift { over, reference, range, change: [rx, ry, rz, tx, ty, tz] }
}

/// The cameras of a calibration file with their extrinsics.
///
/// # Errors
///
/// [`RecordError`], where a piece is unknown or has other parameters than this register's.
pub fn cameras_from_record(record: &Calibration, register: &Register) -> Result<Vec<PlacedCamera>, RecordError> {
    let placed = |camera: &CameraRecord| {
        Ok(PlacedCamera {
            name: camera.name.clone(),
            camera: camera_from_record(camera, register)?,
            camera_from_rig: camera.camera_from_rig.camera_from_rig(),
            drift: camera.camera_from_rig.drift.as_ref().map(drift_of),
        })
    };
    record.cameras().map(placed).collect()
}

/// Covariance of those parameters of a camera that its calibration has estimated, with their places in [`Camera::theta`]; `None`
/// without any.
pub fn covariance_of(record: &Calibration, camera: &PlacedCamera) -> Option<(Vec<usize>, DMatrix<f64>)> {
    let covariance = record.covariance.as_ref()?;
    let rows: BTreeMap<&str, usize> =
        covariance.parameters.iter().enumerate().map(|(row, name)| (name.as_str(), row)).collect();
    let row = |name: &str| match record.is_short() {
        true => rows.get(name),
        false => rows.get(format!("{}/{name}", camera.name).as_str()),
    };
    let names = parameter_names(&camera.camera);
    let estimated: Vec<(usize, usize)> =
        names.iter().enumerate().filter_map(|(place, (name, _))| Some((place, *row(name)?))).collect();
    let entry = |i: usize, j: usize| covariance.matrix[estimated[i].1][estimated[j].1];
    let n = estimated.len();
    (n > 0).then(|| (estimated.iter().map(|(place, _)| *place).collect(), DMatrix::from_fn(n, n, entry)))
}

/// A camera without a name, as the only one of its rig.
pub fn unnamed_camera(camera: Camera) -> PlacedCamera {
    PlacedCamera { name: CAMERA.to_owned(), camera, camera_from_rig: Isometry3::identity(), drift: None }
}
