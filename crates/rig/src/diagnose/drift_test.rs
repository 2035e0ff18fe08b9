//! Whether places change with time or temperature: the effect `extrinsics_drift`.

use std::collections::BTreeMap;

use depthcal_io::{DriftOver, GainInterval};
use depthcal_statistics::{Bootstrap, chi_squared_tail};
use nalgebra::{DVector, Isometry3};

use crate::adjust::RigAdjustment;
use crate::calibrate::RigCalibrated;
use crate::drift::PlaceDrift;
use crate::error::RigError;
use crate::state::RigState;

/// Fewest frames of a camera.
const FEWEST_FRAMES: usize = 8;
/// Decrease of the cost by a step below which an adjustment ends.
const DECREASE: f64 = 1e-4;
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
    pub left_out: Option<DriftLeftOut>,
    /// Whether the change is certain: it lowers the error on left-out frames, and the 95 % interval of the fall excludes 0.
    pub certain: bool,
}

/// Errors of a camera's observations of a board that the other cameras place, on left-out frames, root mean square in standard
/// deviations of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftLeftOut {
    /// With a constant place.
    pub before: f64,
    /// With a place that changes.
    pub after: f64,
    /// Its fall, per cent, with a 95 % interval over frames.
    pub gain_percent: GainInterval,
}

/// Tests every camera but the reference for a place that changes with time, and with temperature, given a calibration without such
/// changes.
///
/// The change is a part of the joint adjustment; its size is held against its covariance (Wald). Where that is significant, the rig
/// is adjusted without every fifth frame, with the change and without, and the camera's markers (depth pixels, of a camera without
/// images) on these frames are compared with where a board that only the other cameras place must be.
///
/// # Errors
///
/// [`RigError`] of an adjustment.
pub fn drift_tests(rig: &RigCalibrated, folds: usize) -> Result<Vec<DriftTest>, RigError> {
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
            test.left_out = left_out(&rig.state, camera, &test.drift, folds)?;
            test.certain = test.left_out.is_some_and(|errors| errors.gain_percent.is_certain());
        }
        judged.push(test);
    }
    Ok(judged)
}

/// A drift of a camera over its frames that changes nothing. `None` where time or temperature is unknown, or frames are few.
fn unchanged(state: &RigState, camera: usize, over: DriftOver) -> Option<PlaceDrift> {
    let own = &state.cameras[camera];
    let values: Vec<f64> = own.frames.iter().map(|f| PlaceDrift::value(over, &state.frames[*f].taken)).collect();
    if values.len() < FEWEST_FRAMES || values.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let reference = values.iter().sum::<f64>() / values.len() as f64;
    Some(PlaceDrift { over, reference, range: high - low, change: [0.0; 6] })
}

/// The state with a drift of one camera.
fn with_drift(state: &RigState, camera: usize, drift: PlaceDrift) -> RigState {
    let mut with = state.clone();
    with.cameras[camera].drift = Some(drift);
    with
}

/// The drift with which the frames fit best, and its Wald test. `None` where the frames leave it open.
fn fitted(state: &RigState, camera: usize, drift: PlaceDrift) -> Result<Option<DriftTest>, RigError> {
    let with = with_drift(state, camera, drift);
    let mut adjustment = RigAdjustment::new(&with)?;
    let adjusted = adjustment.solve_within(DECREASE)?;
    let (Some(change), Some(variable)) = (adjusted.drift[camera], adjustment.drift_variable(camera)) else {
        return Ok(None);
    };
    let Ok(covariance) = adjustment.covariance() else { return Ok(None) };
    let own = covariance.joint(&[variable]);
    let std_devs: [f64; 6] = std::array::from_fn(|i| own[(i, i)].max(0.0).sqrt());
    // Correlations are inverted, whose entries are of one size: ω is in rad, τ in mm.
    let whitened = DVector::from_fn(6, |i, _| change[i] / std_devs[i]);
    let correlation = nalgebra::DMatrix::from_fn(6, 6, |i, j| own[(i, j)] / (std_devs[i] * std_devs[j]));
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

/// Errors on frames that are left out, one in so many as there are folds at a time. `None` where no other camera places the board.
fn left_out(
    state: &RigState,
    camera: usize,
    drift: &PlaceDrift,
    folds: usize,
) -> Result<Option<DriftLeftOut>, RigError> {
    // Sums of squares before and after, and the number of observations, by frame.
    let mut frames: BTreeMap<usize, ([f64; 2], usize)> = BTreeMap::new();
    for fold in 0..folds {
        let held: Vec<bool> = (0..state.frames.len()).map(|i| i % folds == fold).collect();
        let models = [state.clone(), with_drift(state, camera, *drift)];
        for (model, whole) in models.iter().enumerate() {
            let mut fitted = whole.subset(|i| !held[i]);
            let adjusted = RigAdjustment::new(&fitted)?.solve_within(DECREASE)?;
            adjusted.give(&mut fitted);
            let numbers: Vec<usize> = (0..held.len()).filter(|i| held[*i]).collect();
            for (frame, squares, count) in errors_given_the_others(&whole.subset(|i| held[i]), &fitted, camera)? {
                let entry = frames.entry(numbers[frame]).or_default();
                entry.0[model] = squares;
                entry.1 = count;
            }
        }
    }
    let total: usize = frames.values().map(|f| f.1).sum();
    if total == 0 {
        return Ok(None);
    }
    let sums: Vec<[f64; 2]> = frames.values().map(|f| f.0).collect();
    let sum = |picked: &[usize], model: usize| picked.iter().map(|i| sums[*i][model]).sum::<f64>();
    let all: Vec<usize> = (0..sums.len()).collect();
    let gain = |picked: &[usize]| 100.0 * (1.0 - (sum(picked, 1) / sum(picked, 0)).sqrt());
    let estimate = Bootstrap::OVER_FRAMES.estimate(sums.len(), gain);
    Ok(Some(DriftLeftOut {
        before: (sum(&all, 0) / total as f64).sqrt(),
        after: (sum(&all, 1) / total as f64).sqrt(),
        gain_percent: GainInterval { value: estimate.value, low: estimate.low, high: estimate.high },
    }))
}

/// Squared whitened residuals of a camera, summed, and their number, of every frame of `held` whose board other cameras place; all
/// cameras as `fitted` has them.
fn errors_given_the_others(
    held: &RigState,
    fitted: &RigState,
    camera: usize,
) -> Result<Vec<(usize, f64, usize)>, RigError> {
    let mut given = held.clone();
    for (own, from) in given.cameras.iter_mut().zip(&fitted.cameras) {
        own.camera = from.camera.clone();
        (own.camera_from_rig, own.drift) = (from.camera_from_rig, from.drift);
    }
    given.place_boards();
    let mut others = given.clone();
    others.cameras[camera].capture.frames.clear();
    others.cameras[camera].frames.clear();
    let mut adjustment = RigAdjustment::new(&others)?;
    adjustment.hold_cameras();
    let poses: Vec<Isometry3<f64>> = adjustment.solve_within(DECREASE)?.rig_from_board;
    for (frame, pose) in given.frames.iter_mut().zip(&poses) {
        frame.rig_from_board = *pose;
    }
    given.place_boards();
    let seen_by_others = |number: &usize| {
        others
            .cameras
            .iter()
            .any(|c| c.frames.iter().zip(&c.capture.frames).any(|(f, frame)| f == number && !frame.markers.is_empty()))
    };
    let [image, depth] = RigAdjustment::new(&given)?.whitened(camera);
    let own = &given.cameras[camera];
    let by_markers = own.has_markers();
    let mut rest = if by_markers { image.iter() } else { depth.iter() };
    let mut errors = Vec::new();
    for (number, frame) in own.frames.iter().zip(&own.capture.frames) {
        let count = if by_markers { 2 * frame.markers.len() } else { frame.samples.len() };
        let squares: f64 = rest.by_ref().take(count).map(|r| r * r).sum();
        if count > 0 && seen_by_others(number) {
            errors.push((*number, squares, count));
        }
    }
    Ok(errors)
}
