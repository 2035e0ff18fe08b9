//! Simulated rigs: their observations as captures, and their true parameters. For tests and studies; the simulator shares no
//! code with what is fitted.

use crate::simulated;
use depthcal_model::{Camera, Register, RegisterError};
use depthcal_simulate::{Pose, RigCameraTruth, RigPoints, RigTruth};
use nalgebra::{DVector, Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::calibrate::{Calibrated, CameraFit};
use crate::observe::PlacedCamera;
use crate::observe::{CameraCapture, Capture};

/// Markers of a frame from which on a camera counts as having seen the board.
const FEWEST: usize = 8;

/// Observations at the point level as a capture. Frames in which a camera sees fewer than eight markers are missed by it.
pub fn rig_capture(points: &RigPoints) -> Capture {
    let cameras = points.truth.cameras.iter().zip(&points.cameras).map(|(truth, observed)| {
        let mut capture = simulated::capture(observed);
        for frame in &mut capture.frames {
            frame.raw.metadata.timestamp_s = Some(frame.time_s);
        }
        if truth.streams.has_image() {
            capture.frames.retain(|frame| frame.markers.len() >= FEWEST);
        } else {
            capture.frames.retain(|frame| frame.has_depth());
        }
        CameraCapture::of(&truth.name, capture)
    });
    Capture { name: "rig".to_owned(), cameras: cameras.collect() }
}

/// A simulated pose in the model's terms.
pub fn pose(pose: &Pose) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| pose.rotation[i][j]));
    let translation = Translation3::from(nalgebra::Vector3::from(pose.translation));
    Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Value of a parameter `PIECE.PARAMETER` of a true camera with a Brown–Conrady lens and a projective D; `None` for others.
pub fn true_value(truth: &RigCameraTruth, parameter: &str) -> Option<f64> {
    let camera = &truth.truth.camera;
    let (piece, name) = parameter.split_once('.')?;
    let named = |names: &[&str], values: &[f64]| names.iter().position(|n| *n == name).map(|i| values[i]);
    match piece {
        "pinhole" => {
            let values =
                [camera.focal_px[0], camera.focal_px[1], camera.centre_px[0], camera.centre_px[1], camera.skew_px];
            named(&["fx", "fy", "cx", "cy", "skew"], &values)
        }
        "brown_conrady" => named(&["k1", "k2", "p1", "p2", "k3"], &camera.lens),
        "projective" => named(&["dx", "dy", "dz", "dw"], &camera.depth),
        _ => None,
    }
}

/// The true cameras, with the pieces that a calibration with a Brown–Conrady lens and, where there is depth, `projective` has.
///
/// # Errors
///
/// [`RegisterError`] where the register lacks these pieces.
pub fn true_cameras(truth: &RigTruth, register: &Register) -> Result<Vec<PlacedCamera>, RegisterError> {
    let placed = |camera: &RigCameraTruth| {
        let true_camera = &camera.truth.camera;
        let with = |name: &str, values: &[f64]| {
            let mut block = register.block(name, None)?;
            block.theta.copy_from_slice(values);
            Ok::<_, RegisterError>(block)
        };
        let mut blocks = vec![with("brown_conrady", &true_camera.lens)?];
        if camera.streams.has_depth() {
            blocks.push(with("projective", &true_camera.depth)?);
        }
        let pinhole = [
            true_camera.focal_px[0],
            true_camera.focal_px[1],
            true_camera.centre_px[0],
            true_camera.centre_px[1],
            true_camera.skew_px,
        ];
        Ok(PlacedCamera {
            name: camera.name.clone(),
            camera: Camera::new(true_camera.width, true_camera.height, pinhole, blocks),
            camera_from_rig: pose(&camera.camera_from_rig),
            drift: None,
        })
    };
    truth.cameras.iter().map(placed).collect()
}

/// Errors of a fit against the truth, true minus estimated, of every free parameter, in the order of the covariance's free
/// rows: number of the row, error.
pub fn errors(fit: &Calibrated, truth: &RigTruth) -> Vec<(usize, f64)> {
    let mut errors = Vec::new();
    let mut row = 0;
    for camera in &fit.cameras {
        let Some(true_camera) = truth.cameras.iter().find(|t| t.name == camera.name) else { continue };
        if let Some(std_devs) = camera.place_std_dev {
            let off = place_error(camera, true_camera);
            let is_free = |i: &usize| std_devs[*i] > 0.0;
            errors.extend((0..6).filter(is_free).map(|i| (row + i, off[i])));
            row += if camera.drift.is_some() { 12 } else { 6 };
            if let Some(offset) = camera.time_offset {
                errors.push((row, true_camera.time_offset_s - offset.value_s));
                row += 1;
            }
        }
        let model = &camera.calibrated.camera;
        let names = crate::calibrate::parameter_names(model);
        for (i, ((name, free), value)) in names.iter().zip(model.theta()).enumerate() {
            if let (true, Some(is)) = (*free, true_value(true_camera, name)) {
                errors.push((row + i, is - value));
            }
        }
        row += names.len();
    }
    errors
}

/// (ω, τ) that lead from the estimated to the true place: rotation R Exp(ω), translation t + τ.
pub fn place_error(camera: &CameraFit, truth: &RigCameraTruth) -> [f64; 6] {
    let is = pose(&truth.camera_from_rig);
    let turn = (camera.camera_from_rig.rotation.inverse() * is.rotation).scaled_axis();
    let shift = is.translation.vector - camera.camera_from_rig.translation.vector;
    [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
}

/// eᵀ Σ⁻¹ e of some errors, normalised squared error, and their number. `None` where the covariance is singular.
pub fn squared_error(fit: &Calibrated, errors: &[(usize, f64)]) -> Option<(f64, usize)> {
    let (n, covariance) = (errors.len(), fit.covariance.as_ref()?);
    let sigma = |i: usize| covariance[(errors[i].0, errors[i].0)].sqrt();
    // Correlations are inverted, whose entries are of one size.
    let correlation =
        nalgebra::DMatrix::from_fn(n, n, |i, j| covariance[(errors[i].0, errors[j].0)] / (sigma(i) * sigma(j)));
    let e = DVector::from_fn(n, |i, _| errors[i].1 / sigma(i));
    Some((e.dot(&correlation.cholesky()?.solve(&e)), n))
}
