//! The driver: cameras alone, places, everything in one adjustment.

use std::ops::Range;

use super::calibrated::{Calibrated, CameraFit, ImagesAlone, TimeOffset};
use super::calibrated_camera::CalibratedCamera;
use super::camera::calibrate_camera;
use super::camera_options::CameraOptions;
use super::contradiction::check_evidence;
use super::error::CalibrateError;
use super::folds::check_invertible;
use super::options::CalibrateOptions;
use super::rig::{Started, compare_with_expected, left_open, start};
use super::rules::{joint_rules, rules_by_node};
use super::settle::{Settled, settle};
use super::two_cameras::check_frames_agree;
use crate::adjust::field_cells::node_count;
use crate::observe::{Capture, SampledFrame};

/// Calibrates the cameras of a capture, of which there may be one: every camera with images alone, the places of several from the
/// views that they share, then all cameras, places and poses of the board in one adjustment, with the noise of every camera
/// estimated on the way. A joint fit that contradicts those of its cameras alone is refused, and one of frames of two cameras.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate(capture: &Capture, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    let fit = fit(capture, options)?;
    check_evidence(&fit)?;
    if let ([only], [fitted]) = (&capture.cameras[..], &fit.cameras[..]) {
        check_frames_agree(&only.capture, &fitted.calibrated, &options.of_only(only))?;
    }
    Ok(fit)
}

/// [`calibrate`] whose cameras may contradict each other, as they do where an effect is missing that a diagnosis searches.
pub(crate) fn fit(capture: &Capture, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    // One camera has its frames' poses, its fields by node and the estimators of the thesis to itself.
    if let [only] = &capture.cameras[..] {
        let fitted = calibrate_camera(&only.capture, &options.of_only(only))?;
        return Ok(Calibrated { name: capture.name.clone(), ..Calibrated::of_camera(&only.name, fitted) });
    }
    let mut started = start(capture, options)?;
    for (camera, drift) in &options.drifts {
        if let Some(drifting) = started.state.cameras.iter_mut().skip(1).find(|c| c.name == *camera) {
            drifting.drift = Some(*drift);
        }
    }
    let calibrated = adjusted(&capture.name, started, options)?;
    compare_with_expected(capture, &calibrated.cameras);
    Ok(calibrated)
}

/// From start values to calibrated cameras.
fn adjusted(name: &str, started: Started, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    let Started { state, pairs, alone, is_declared } = started;
    let _stage = options.each.progress.stage("joint adjustment of the rig");
    // The fit of a camera alone has chosen the smoothness of a field whose nodes are variables of their own.
    let nodes = state.cameras.iter().filter_map(|camera| node_count(&camera.camera)).reduce(|a, b| a + b);
    let rules = nodes.map_or_else(joint_rules, rules_by_node);
    let settled = settle(state, &rules, &options.each)?;
    let mut cameras = Vec::new();
    for (number, alone) in alone.into_iter().enumerate() {
        let mut camera = camera_fit(&settled, number, alone, &options.each);
        let (state, stds) = (&settled.state.cameras[number], camera.calibrated.std_devs());
        camera.left_open = left_open(&state.camera, &state.priors, &stds, is_declared[number]);
        if camera.calibrated.with_depth {
            check_invertible(&camera.calibrated)
                .map_err(|source| CalibrateError::of_camera(&camera.name)(source.into()))?;
        }
        cameras.push(camera);
    }
    let Settled { state, adjusted, covariance, .. } = settled;
    Ok(Calibrated {
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

/// A camera's part of the fit; `alone` is what it gave alone, and its images.
fn camera_fit(
    settled: &Settled<SampledFrame>,
    number: usize,
    (alone, images_alone): (CalibratedCamera, Option<ImagesAlone>),
    options: &CameraOptions,
) -> CameraFit {
    let camera = &settled.state.cameras[number];
    let rows = &settled.state.parameter_rows()[number];
    let std_dev = |row: usize| settled.covariance.as_ref().map_or(f64::NAN, |c| c[(row, row)].max(0.0).sqrt());
    let of_tangent = |rows: &Range<usize>| std::array::from_fn(|i| std_dev(rows.start + i));
    let value_s = camera.offset_s.filter(|_| !rows.offset.is_empty());
    let calibrated = CalibratedCamera {
        foreign_depth: alone.foreign_depth,
        lens_choice: alone.lens_choice,
        lens_comparison: alone.lens_comparison,
        prior: alone.prior,
        estimator: alone.estimator,
        model: alone.model,
        ..settled.camera(number, options)
    };
    CameraFit {
        name: camera.name.clone(),
        camera_from_rig: camera.camera_from_rig,
        place_std_dev: (!rows.extrinsics.is_empty()).then(|| of_tangent(&rows.extrinsics)),
        drift: camera.drift.filter(|_| !rows.drift.is_empty()).map(|drift| (drift, of_tangent(&rows.drift))),
        time_offset: value_s.map(|value_s| TimeOffset { value_s, std_dev_s: std_dev(rows.offset.start) }),
        calibrated,
        alone: images_alone,
        left_open: Vec::new(),
    }
}
