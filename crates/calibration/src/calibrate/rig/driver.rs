//! The driver: cameras alone, places, everything in one adjustment.

use std::ops::Range;

use crate::calibrate::{Calibrated, check_invertible};
use depthcal_statistics::rms;
use nalgebra::DMatrix;

use super::depth_camera_prior::left_open;
use super::fitted::{CameraFit, PLACE, RigCalibrated, TimeOffset};
use super::options::RigOptions;
use super::settle::{Settled, inverse_depth_residuals, settle};
use super::start::{Started, start};
use crate::adjust::rig_state::{CameraState, RigState};
use crate::calibrate::CalibrateError;
use crate::observe::RigCapture;

/// Calibrates a rig: every camera with images alone, the places of the cameras from the views that they share, then all
/// cameras, places and poses of the board in one adjustment, with the noise of every camera estimated on the way.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate_rig(capture: &RigCapture, options: &RigOptions) -> Result<RigCalibrated, CalibrateError> {
    let mut started = start(capture, options)?;
    for (camera, drift) in &options.drifts {
        if let Some(own) = started.state.cameras.iter_mut().skip(1).find(|c| c.name == *camera) {
            own.drift = Some(*drift);
        }
    }
    fit(&capture.name, started, options)
}

/// From start values to a calibrated rig.
fn fit(name: &str, started: Started, options: &RigOptions) -> Result<RigCalibrated, CalibrateError> {
    let Started { mut state, pairs, alone, is_declared } = started;
    let _stage = options.each.progress.stage("joint adjustment of the rig");
    let Settled { adjustment, adjusted, covariance } = settle(&mut state)?;
    let covariance = covariance.joint(&adjustment.variables());
    let mut cameras = Vec::new();
    for (number, (range, alone)) in ranges(&state).into_iter().zip(alone).enumerate() {
        let residuals = [&adjusted.image_residuals[number], &adjusted.depth_residuals[number]].map(Vec::as_slice);
        let mut camera = camera_fit(&state.cameras[number], number, (&covariance, range), residuals, alone);
        let (own, stds) = (&state.cameras[number], camera.calibrated.std_devs());
        camera.left_open = left_open(&own.camera, &own.priors, &stds, is_declared[number]);
        if camera.calibrated.with_depth {
            check_invertible(&camera.calibrated)
                .map_err(|source| CalibrateError::of_camera(&camera.name)(source.into()))?;
        }
        cameras.push(camera);
    }
    Ok(RigCalibrated {
        name: name.to_owned(),
        cameras,
        frames: state.frames.clone(),
        covariance,
        pairs,
        cost: adjusted.report.cost,
        iterations: adjusted.report.iterations,
        termination: adjusted.report.termination.to_string(),
        state,
    })
}

/// Rows of every camera in the joint covariance: its place, but of the reference, then its parameters.
fn ranges(state: &RigState) -> Vec<Range<usize>> {
    let mut first = 0;
    let range = |(number, camera): (usize, &CameraState)| {
        let drift = usize::from(number > 0 && camera.drift.is_some());
        let offset = usize::from(number > 0 && camera.offset_s.is_some());
        let places = if number == 0 { 0 } else { PLACE.len() * (1 + drift) + offset };
        let start = first;
        first += places + camera.camera.theta().len();
        start..first
    };
    state.cameras.iter().enumerate().map(range).collect()
}

fn camera_fit(
    camera: &CameraState,
    number: usize,
    (covariance, range): (&DMatrix<f64>, Range<usize>),
    [image, depth]: [&[f64]; 2],
    alone: Calibrated,
) -> CameraFit {
    let std_devs = |first: usize| std::array::from_fn(|i| covariance[(first + i, first + i)].max(0.0).sqrt());
    let place_std_dev = (number > 0).then(|| std_devs(range.start));
    let drift = camera.drift.filter(|_| number > 0).map(|drift| (drift, std_devs(range.start + PLACE.len())));
    let parameters = camera.camera.theta().len();
    let offset_row = range.end - parameters;
    let time_offset = camera
        .offset_s
        .filter(|_| number > 0)
        .map(|value_s| TimeOffset { value_s, std_dev_s: covariance[(offset_row - 1, offset_row - 1)].max(0.0).sqrt() });
    let own = covariance.view((range.end - parameters, range.end - parameters), (parameters, parameters)).into_owned();
    let stds = camera.capture.frames.iter().flat_map(|f| f.markers.iter().map(|m| m.std_px));
    // The noise in which residuals are whitened is that of the round before; they differ by less than a per cent.
    let distances = image.chunks_exact(2).zip(stds).map(|(r, std)| r[0].hypot(r[1]) * std * camera.noise.pixel_sigma);
    let depth_mm = inverse_depth_residuals(camera, depth).into_iter().map(|(rho, r)| 1.0 / (rho - r) - 1.0 / rho);
    let with_depth = camera.has_depth();
    let calibrated = Calibrated {
        camera: camera.camera.clone(),
        capture: camera.capture.clone(),
        covariance: Some(own),
        noise: camera.noise,
        with_depth,
        correlation_length_px: camera.correlation_length_px,
        outliers: camera.outliers,
        smoothness: camera.smoothness.clone(),
        reprojection_rms_px: rms(distances),
        depth_rms_mm: with_depth.then(|| rms(depth_mm)),
        ..alone
    };
    CameraFit {
        name: camera.name.clone(),
        camera_from_rig: camera.camera_from_rig,
        place_std_dev,
        drift,
        time_offset,
        calibrated,
        left_open: Vec::new(),
    }
}
