//! Between calibrated rigs in memory and `calibration.json`.

use std::collections::BTreeMap;

use crate::calibration_record::{
    RecordError, camera_from_record, declarations, noise_record, parameter_names, piece_records,
};
use depthcal_io::{
    CAMERA, Calibration, CameraRecord, CovarianceRecord, DriftRecord, DroppedFrame, ExtrinsicsRecord, ExtrinsicsStdDev,
    FileReference, FitRecord, FrameRecord, TimeOffsetRecord,
};
use depthcal_model::{Camera, Register};
use depthcal_statistics::rms;
use nalgebra::{DMatrix, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::calibrate::rig::{CameraFit, RigCalibrated};
use crate::judge::rig::EvaluatedRig;
use crate::observe::PlaceDrift;
use crate::observe::PlacedCamera;

/// The file's content for a calibrated rig. `fitted` is the evaluation of the fitted frames; it gives the errors of each frame.
/// `None` for a rig without cameras, which no calibration gives.
pub fn rig_record(result: &RigCalibrated, fitted: &EvaluatedRig, dataset: FileReference) -> Option<Calibration> {
    let reference = result.cameras.first()?;
    let names = result.parameters();
    let free: Vec<usize> = (0..names.len()).filter(|i| names[*i].1 && result.covariance[(*i, *i)] > 0.0).collect();
    let covariance = CovarianceRecord {
        parameters: free.iter().map(|i| names[*i].0.clone()).collect(),
        matrix: free.iter().map(|i| free.iter().map(|j| result.covariance[(*i, *j)]).collect()).collect(),
    };
    let mut cameras = result.cameras.iter().map(camera_record);
    let dropped = |camera: &CameraFit| {
        let named =
            |d: &DroppedFrame| DroppedFrame { name: format!("{}/{}", camera.name, d.name), reason: d.reason.clone() };
        camera.calibrated.capture.dropped.iter().map(named).collect::<Vec<_>>()
    };
    let with_depth = result.cameras.iter().find(|c| c.calibrated.with_depth).unwrap_or(reference);
    Some(Calibration {
        camera: cameras.next()?,
        others: cameras.collect(),
        covariance: Some(covariance),
        fit: FitRecord {
            estimator: "joint".to_owned(),
            model: with_depth.calibrated.model.to_string(),
            lens_comparison: None,
            prior: None,
            reprojection_rms_px: reference.calibrated.reprojection_rms_px,
            depth_rms_mm: reference.calibrated.depth_rms_mm,
            frames_used: result.frames.len(),
            frames_dropped: result.cameras.iter().flat_map(dropped).collect(),
            declarations: result.cameras.iter().flat_map(|c| declarations(&c.calibrated)).collect(),
            termination: result.termination.clone(),
            cost: result.cost,
            iterations: result.iterations,
        },
        frames: frame_records(result, fitted),
        dataset,
        target: reference.calibrated.capture.target.clone(),
        observations: None,
    })
}

fn camera_record(camera: &CameraFit) -> CameraRecord {
    let fit = &camera.calibrated;
    let std_dev = camera.place_std_dev.filter(|std_dev| *std_dev != [0.0; 6]).map(std_dev_record);
    let (rotation, translation_mm) = numbers(&camera.camera_from_rig);
    CameraRecord {
        name: camera.name.clone(),
        width: fit.camera.width,
        height: fit.camera.height,
        camera_from_rig: ExtrinsicsRecord { rotation, translation_mm, std_dev, drift: camera.drift.map(drift_record) },
        pieces: piece_records(&fit.camera, &fit.std_devs()),
        noise: noise_record(fit),
        time_offset: camera
            .time_offset
            .map(|offset| TimeOffsetRecord { value_s: offset.value_s, std_dev_s: offset.std_dev_s }),
        depth_unit_mm: fit.capture.depth_unit_mm,
        frames_used: fit.capture.frames.len(),
        reprojection_rms_px: camera.has_markers().then_some(fit.reprojection_rms_px),
        depth_rms_mm: fit.depth_rms_mm,
        left_open: camera.left_open.clone(),
    }
}

fn std_dev_record([rx, ry, rz, tx, ty, tz]: [f64; 6]) -> ExtrinsicsStdDev {
    ExtrinsicsStdDev { rotation_rad: [rx, ry, rz], translation_mm: [tx, ty, tz] }
}

/// The record of a place that changes, with the standard deviations of the change.
pub fn drift_record((drift, std_devs): (PlaceDrift, [f64; 6])) -> DriftRecord {
    let [rx, ry, rz, tx, ty, tz] = drift.change;
    DriftRecord {
        over: drift.over,
        reference: drift.reference,
        range: drift.range,
        rotation_rad: [rx, ry, rz],
        translation_mm: [tx, ty, tz],
        std_dev: Some(std_dev_record(std_devs)),
    }
}

fn drift_of(record: &DriftRecord) -> PlaceDrift {
    let ([rx, ry, rz], [tx, ty, tz]) = (record.rotation_rad, record.translation_mm);
    let DriftRecord { over, reference, range, .. } = *record;
    PlaceDrift { over, reference, range, change: [rx, ry, rz, tx, ty, tz] }
}

fn numbers(pose: &Isometry3<f64>) -> ([f64; 4], [f64; 3]) {
    let (q, t) = (pose.rotation.quaternion(), pose.translation.vector);
    ([q.w, q.i, q.j, q.k], [t.x, t.y, t.z])
}

fn frame_records(result: &RigCalibrated, fitted: &EvaluatedRig) -> Vec<FrameRecord> {
    // Distances of the markers of all cameras, and squares and numbers of their depth errors.
    let mut errors: BTreeMap<&str, (Vec<f64>, f64, usize)> = BTreeMap::new();
    for frame in fitted.cameras.iter().flat_map(|(_, evaluated)| &evaluated.frames) {
        let (distances, squares, pixels) = errors.entry(&frame.name).or_default();
        distances.extend(frame.reprojection.iter().map(|e| e[2].hypot(e[3])));
        if let Some(depth) = frame.depth.rms_mm() {
            *squares += depth.after * depth.after * frame.depth.pixels as f64;
            *pixels += frame.depth.pixels;
        }
    }
    let record = |frame: &crate::adjust::state::RigFrame| {
        let (rotation, translation_mm) = numbers(&frame.rig_from_board);
        let of_frame = errors.get(frame.name.as_str());
        let depth = of_frame.filter(|(_, _, pixels)| *pixels > 0).map(|(_, s, n)| (s / *n as f64).sqrt());
        FrameRecord {
            name: frame.name.clone(),
            rotation,
            translation_mm,
            reprojection_rms_px: of_frame.map_or(0.0, |(distances, ..)| rms(distances.iter().copied())),
            depth_rms_mm: depth,
            metadata: frame.metadata.clone(),
        }
    };
    result.frames.iter().map(record).collect()
}

/// The cameras of a calibration file with their extrinsics.
///
/// # Errors
///
/// [`RecordError`], where a piece is unknown or has other parameters than this register's.
pub fn cameras_from_record(record: &Calibration, register: &Register) -> Result<Vec<PlacedCamera>, RecordError> {
    let placed = |camera: &CameraRecord| {
        let [w, x, y, z] = camera.camera_from_rig.rotation;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let translation = Translation3::from(Vector3::from(camera.camera_from_rig.translation_mm));
        Ok(PlacedCamera {
            name: camera.name.clone(),
            camera: camera_from_record(camera, register)?,
            camera_from_rig: Isometry3::from_parts(translation, rotation),
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
