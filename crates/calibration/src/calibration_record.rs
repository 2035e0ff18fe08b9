//! From calibrated cameras in memory to `calibration.json`.

use std::collections::BTreeMap;

use depthcal_io::{
    Calibration, CameraRecord, CovarianceRecord, DriftRecord, DroppedFrame, ExtrinsicsRecord, ExtrinsicsStdDev,
    FileReference, FitRecord, FrameRecord, TimeOffsetRecord,
};
use depthcal_statistics::rms;
use nalgebra::{DMatrix, Isometry3};

use crate::adjust::state::RigFrame;
use crate::calibrate::{Calibrated, CameraFit};
use crate::camera_record::{declarations, noise_record, piece_records, prior_use};
use crate::judge::camera::EvaluatedFrame;
use crate::judge::evaluate::Evaluated;
use crate::observe::PlaceDrift;

/// The file's content for calibrated cameras. `fitted` is the evaluation of the fitted frames; it gives the errors of each frame.
pub fn calibration_record(
    result: &Calibrated,
    fitted: &Evaluated,
    dataset: FileReference,
    observations: Option<FileReference>,
) -> Calibration {
    let reference = &result.reference().calibrated;
    let only = result.only_camera();
    let with_depth = result.cameras.iter().map(|c| &c.calibrated).find(|c| c.with_depth).unwrap_or(reference);
    Calibration {
        camera: camera_record(result.reference()),
        others: result.cameras.iter().skip(1).map(camera_record).collect(),
        covariance: result.covariance.as_ref().map(|covariance| covariance_record(&result.parameters(), covariance)),
        fit: FitRecord {
            estimator: reference.estimator.name().to_owned(),
            model: with_depth.model.to_string(),
            lens_comparison: only.and_then(|camera| camera.lens_comparison.clone()),
            prior: only.and_then(prior_use),
            reprojection_rms_px: reference.reprojection_rms_px,
            depth_rms_mm: reference.depth_rms_mm,
            frames_used: result.frames.len(),
            frames_dropped: dropped(result),
            declarations: result.cameras.iter().flat_map(|c| declarations(&c.calibrated)).collect(),
            termination: result.termination.clone(),
            cost: result.cost,
            iterations: result.iterations,
        },
        frames: frame_records(result, fitted),
        dataset,
        target: reference.capture.target.clone(),
        observations,
    }
}

/// The covariance of the parameters that were estimated; `names` says which are free.
fn covariance_record(names: &[(String, bool)], covariance: &DMatrix<f64>) -> CovarianceRecord {
    let free: Vec<usize> = (0..names.len()).filter(|i| names[*i].1 && covariance[(*i, *i)] > 0.0).collect();
    CovarianceRecord {
        parameters: free.iter().map(|i| names[*i].0.clone()).collect(),
        matrix: free.iter().map(|i| free.iter().map(|j| covariance[(*i, *j)]).collect()).collect(),
    }
}

/// The frames that were left out; those of several cameras begin with the camera's name.
fn dropped(result: &Calibrated) -> Vec<DroppedFrame> {
    if let Some(only) = result.only_camera() {
        return only.capture.dropped.clone();
    }
    let of_camera = |camera: &CameraFit| {
        let named =
            |d: &DroppedFrame| DroppedFrame { name: format!("{}/{}", camera.name, d.name), reason: d.reason.clone() };
        camera.calibrated.capture.dropped.iter().map(named).collect::<Vec<_>>()
    };
    result.cameras.iter().flat_map(of_camera).collect()
}

fn camera_record(camera: &CameraFit) -> CameraRecord {
    let fit = &camera.calibrated;
    let std_dev = camera.place_std_dev.and_then(std_dev_record);
    let (rotation, translation_mm) = numbers(&camera.camera_from_rig);
    CameraRecord {
        name: camera.name.clone(),
        width: fit.camera.width,
        height: fit.camera.height,
        camera_from_rig: ExtrinsicsRecord { rotation, translation_mm, std_dev, drift: camera.drift.map(drift_record) },
        pieces: piece_records(&fit.camera, &fit.std_devs()),
        noise: noise_record(fit),
        time_offset: camera.time_offset.map(|offset| TimeOffsetRecord {
            value_s: offset.value_s,
            std_dev_s: Some(offset.std_dev_s).filter(|std_dev| std_dev.is_finite()),
        }),
        depth_unit_mm: fit.capture.depth_unit_mm,
        disparity: fit.capture.disparity,
        frames_used: fit.capture.frames.len(),
        reprojection_rms_px: camera.has_markers().then_some(fit.reprojection_rms_px),
        depth_rms_mm: fit.depth_rms_mm,
        left_open: camera.left_open.clone(),
    }
}

/// `None` of what is known, or where the covariance is out of reach.
fn std_dev_record([rx, ry, rz, tx, ty, tz]: [f64; 6]) -> Option<ExtrinsicsStdDev> {
    (rx > 0.0).then_some(ExtrinsicsStdDev { rotation_rad: [rx, ry, rz], translation_mm: [tx, ty, tz] })
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
        std_dev: std_dev_record(std_devs),
    }
}

fn numbers(pose: &Isometry3<f64>) -> ([f64; 4], [f64; 3]) {
    let (q, t) = (pose.rotation.quaternion(), pose.translation.vector);
    ([q.w, q.i, q.j, q.k], [t.x, t.y, t.z])
}

fn frame_records(result: &Calibrated, fitted: &Evaluated) -> Vec<FrameRecord> {
    let mut evaluated: BTreeMap<&str, Vec<&EvaluatedFrame>> = BTreeMap::new();
    for frame in fitted.cameras.iter().flat_map(|(_, camera)| &camera.frames) {
        evaluated.entry(&frame.name).or_default().push(frame);
    }
    let record = |frame: &RigFrame| {
        let (rotation, translation_mm) = numbers(&frame.rig_from_board);
        let by_camera = evaluated.get(frame.name.as_str()).map_or(&[][..], Vec::as_slice);
        FrameRecord {
            name: frame.name.clone(),
            rotation,
            translation_mm,
            reprojection_rms_px: rms(by_camera.iter().flat_map(|f| f.reprojection.iter().map(|e| e[2].hypot(e[3])))),
            depth_rms_mm: depth_rms_mm(by_camera),
            metadata: frame.metadata.clone(),
        }
    };
    result.frames.iter().map(record).collect()
}

/// Root mean square of the depth errors of all cameras in a frame after correction; `None` without depth.
fn depth_rms_mm(by_camera: &[&EvaluatedFrame]) -> Option<f64> {
    if let [only] = by_camera {
        return only.depth.rms_mm().map(|rms| rms.after);
    }
    let with_depth = || by_camera.iter().filter_map(|frame| Some((frame.depth.rms_mm()?.after, frame.depth.pixels)));
    let squares: f64 = with_depth().map(|(rms, pixels)| rms * rms * pixels as f64).sum();
    let pixels: usize = with_depth().map(|(_, pixels)| pixels).sum();
    (pixels > 0).then(|| (squares / pixels as f64).sqrt())
}
