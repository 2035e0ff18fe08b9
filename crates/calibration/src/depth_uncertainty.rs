//! Uncertainty of corrected depth, from calibrations in memory and from `calibration.json`.

use depthcal_io::Calibration;
use depthcal_model::uncertainty::{DepthNoise, Support, UncertainCamera, UncertainDepth};
use depthcal_model::{Context, Quantities};
use depthcal_statistics::quantile;
use nalgebra::DMatrix;

use crate::calibrate::CalibratedCamera;
use crate::camera_record::covariance_of;
use crate::observe::PlacedCamera;

/// Uncertainty of the depth that a camera of a calibration corrects; `None` where the calibration has no noise of depth. Without
/// a covariance it is that of noise alone.
///
/// Frames of a rig count as seen by every camera in whose image the board was.
pub fn uncertain_depth(record: &Calibration, placed: &PlacedCamera) -> Option<UncertainDepth> {
    let of_camera = record.cameras().find(|camera| camera.name == placed.name)?;
    let noise = match (of_camera.noise.inverse_depth_sigma_a, of_camera.noise.inverse_depth_sigma_b) {
        (None, None) => return None,
        (a, b) => DepthNoise { a_per_mm: a.unwrap_or(0.0), b_mm: b.unwrap_or(0.0) },
    };
    let uncertain = match covariance_of(record, placed) {
        Some((places, covariance)) => UncertainCamera::new(placed.camera.clone(), &places, &covariance),
        None => UncertainCamera::exact(placed.camera.clone()),
    };
    let temperatures = record.frames.iter().filter_map(|frame| frame.metadata.temperature_c);
    let times = || record.frames.iter().filter_map(|frame| frame.metadata.timestamp_s);
    let first = times().fold(f64::INFINITY, f64::min);
    let conditions = Context {
        temperature_c: quantile(temperatures, 0.5),
        quantities: usual_quantities(record),
        time_s: times().next().map_or(0.0, |_| quantile(times().map(|t| t - first), 0.5)),
        ..Context::default()
    };
    let mut depth = UncertainDepth::new(&uncertain, noise, conditions);
    depth.support = support_of(record, placed);
    Some(depth)
}

/// Where a camera of a calibration saw boards, and at which distances; `None` where it saw none.
pub fn support_of(record: &Calibration, placed: &PlacedCamera) -> Option<Support> {
    let poses: Vec<_> = record.frames.iter().map(|f| placed.camera_from_rig * f.rig_from_board()).collect();
    Support::of_boards(&placed.camera, record.target.marker_rectangle(), &poses)
}

/// The further quantities of a calibration's frames at their medians.
pub(crate) fn usual_quantities(record: &Calibration) -> Quantities {
    let all: Vec<Quantities> = record.frames.iter().map(|frame| frame.metadata.quantities()).collect();
    Quantities::summarized(all.iter(), |values| quantile(values, 0.5))
}

/// Uncertainty of the depth that a fitted camera corrects, under given conditions, with the covariance of all its parameters,
/// zeros for those that are fixed.
pub fn uncertain_depth_of(fit: &CalibratedCamera, covariance: &DMatrix<f64>, conditions: Context) -> UncertainDepth {
    let places: Vec<usize> = (0..covariance.nrows()).filter(|i| covariance[(*i, *i)] > 0.0).collect();
    let of_free = covariance.select_rows(&places).select_columns(&places);
    let uncertain = UncertainCamera::new(fit.camera.clone(), &places, &of_free);
    let mut depth = UncertainDepth::new(&uncertain, fit.noise.depth, conditions);
    let poses: Vec<_> = fit.capture.poses().collect();
    depth.support = Support::of_boards(&fit.camera, fit.capture.target.marker_rectangle(), &poses);
    depth
}
