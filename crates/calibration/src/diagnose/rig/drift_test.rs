//! Whether places change with time or temperature: the effect `extrinsics_drift`.

use depthcal_io::{DriftOver, RigLeftOut};
use depthcal_statistics::chi_squared_tail;
use nalgebra::DVector;

use super::left_out::{DECREASE, left_out};
use crate::adjust::adjustment::Adjustment;
use crate::adjust::state::State;
use crate::calibrate::Calibrated;
use crate::diagnose::DiagnoseError;
use crate::observe::PlaceDrift;

/// Fewest frames of a camera.
const FEWEST_FRAMES: usize = 8;
/// p-value, corrected for the number of tests, below which left-out frames are looked at.
const SIGNIFICANT: f64 = 0.01;
/// Least range of time (s) and of temperature (°C) over which anything drifts.
const LEAST_RANGE: [f64; 2] = [1.0, 0.5];

/// A test of whether the place of a camera changes.
#[derive(Debug, Clone, PartialEq)]
pub struct DriftTest {
    /// The camera.
    pub camera: String,
    /// The change that fits its frames best.
    pub drift: PlaceDrift,
    /// Standard deviations of the change.
    pub std_devs: [f64; 6],
    /// Probability of as large a change by noise alone, corrected for the number of tests.
    pub p_value: f64,
    /// Errors on left-out frames; `None` where the p-value gives no reason to look at them.
    pub left_out: Option<RigLeftOut>,
    /// Whether the change is certain: it lowers the error on left-out frames, and the 95 % interval of the fall excludes 0.
    pub certain: bool,
}

/// Tests every camera but the reference for a place that changes with time, and with temperature, given a calibration without
/// such changes.
///
/// The change is a part of the joint adjustment; its size is held against its covariance (Wald). Where that is significant, the
/// rig is adjusted without every fifth frame, with the change and without, and the camera's markers (depth pixels, of a camera
/// without images) on these frames are compared with where a board that only the other cameras place must be.
///
/// # Errors
///
/// [`DiagnoseError`] of an adjustment.
pub fn drift_tests(rig: &Calibrated, folds: usize) -> Result<Vec<DriftTest>, DiagnoseError> {
    let mut tests = Vec::new();
    for camera in 1..rig.state.cameras.len() {
        for (over, least) in [DriftOver::Time, DriftOver::Temperature].into_iter().zip(LEAST_RANGE) {
            if let Some(drift) = unchanged(&rig.state, camera, over).filter(|drift| drift.range > least) {
                tests.extend(fitted(&rig.state, camera, drift)?.map(|test| (camera, test)));
            }
        }
    }
    let count = tests.len() as f64;
    let mut judged = Vec::new();
    for (camera, mut test) in tests {
        test.p_value = (test.p_value * count).min(1.0);
        if test.p_value < SIGNIFICANT {
            let with = with_drift(&rig.state, camera, test.drift);
            test.left_out = left_out([&rig.state, &with], camera, folds)?;
            test.certain = test.left_out.is_some_and(|errors| errors.gain_percent.is_certain());
        }
        judged.push(test);
    }
    Ok(judged)
}

/// A drift of a camera over its frames that changes nothing. `None` where time or temperature is unknown, or frames are few.
fn unchanged(state: &State, camera: usize, over: DriftOver) -> Option<PlaceDrift> {
    let drifting = &state.cameras[camera];
    let values: Vec<f64> = drifting.frames.iter().map(|f| PlaceDrift::value(over, &state.frames[*f].taken)).collect();
    if values.len() < FEWEST_FRAMES || values.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let reference = values.iter().sum::<f64>() / values.len() as f64;
    Some(PlaceDrift { over, reference, range: high - low, change: [0.0; 6] })
}

/// The state with a drift of one camera.
fn with_drift(state: &State, camera: usize, drift: PlaceDrift) -> State {
    let mut with = state.clone();
    with.cameras[camera].drift = Some(drift);
    with
}

/// The drift with which the frames fit best, and its Wald test. `None` where the frames leave it open.
fn fitted(state: &State, camera: usize, drift: PlaceDrift) -> Result<Option<DriftTest>, DiagnoseError> {
    let with = with_drift(state, camera, drift);
    let mut adjustment = Adjustment::of_state(&with, true)?;
    let adjusted = adjustment.refine_within(DECREASE)?;
    let (Some(change), Some(variable)) = (adjusted.cameras[camera].drift, adjustment.drift_variable(camera)) else {
        return Ok(None);
    };
    let Ok(covariance) = adjustment.covariance() else { return Ok(None) };
    let drift_covariance = covariance.joint(&[variable]);
    let std_devs: [f64; 6] = std::array::from_fn(|i| drift_covariance[(i, i)].max(0.0).sqrt());
    // Correlations are inverted, whose entries are of one size: ω is in rad, τ in mm.
    let whitened = DVector::from_fn(6, |i, _| change[i] / std_devs[i]);
    let correlation = nalgebra::DMatrix::from_fn(6, 6, |i, j| drift_covariance[(i, j)] / (std_devs[i] * std_devs[j]));
    let Some(cholesky) = correlation.cholesky() else { return Ok(None) };
    let statistic = whitened.dot(&cholesky.solve(&whitened));
    Ok(Some(DriftTest {
        camera: state.cameras[camera].name.clone(),
        drift: PlaceDrift { change, ..drift },
        std_devs,
        p_value: chi_squared_tail(statistic, 6),
        left_out: None,
        certain: false,
    }))
}
