//! The loop of a rig's calibration: adjust all cameras together, estimate the noise of each, drop outliers, until nothing
//! changes.

use crate::observe::AdjustableFrame;
use crate::observe::noise::{DepthNoise, clipped_sigma};
use depthcal_model::Camera;
use depthcal_solver::{Covariance, CovarianceError, NullDirection};
use tracing::debug;

use crate::adjust::rig_adjustment::{Adjusted, RigAdjustment};
use crate::adjust::rig_state::{CameraState, RigState};
use crate::calibrate::CalibrateError;

/// Rounds of adjustment and noise estimation.
const ROUNDS: usize = 4;
/// Relative change of a standard deviation below which the noise has settled: of markers, and of depth.
const SETTLED: [f64; 2] = [0.01, 0.02];
/// Decrease of the cost by a step below which the first adjustment ends, before the noise is known, and later ones, as for one
/// camera.
const FIRST_DECREASE: f64 = 1e-3;
const LAST_DECREASE: f64 = 1e-4;
/// Markers and inverse depth are never taken for more precise than this, px and 1/mm: simulated ones may be exact.
const LEAST_PIXEL_SIGMA: f64 = 1e-4;
const LEAST_INVERSE_DEPTH_SIGMA: f64 = 1e-9;
/// Depth samples beyond this many standard deviations are outliers.
const OUTLIER: f64 = 8.0;
/// Share of a combination's largest parameter, in typical deviations, from which on a parameter is named.
const NAMED_SHARE: f64 = 0.03;

/// A settled adjustment.
pub(super) struct Settled {
    pub adjustment: RigAdjustment,
    pub adjusted: Adjusted,
    pub covariance: Covariance,
}

/// Adjusts until noise and outliers have settled; the state is then that of the last adjustment.
///
/// # Errors
///
/// [`CalibrateError`] of the adjustment, or where it has not converged.
pub(super) fn settle(state: &mut RigState) -> Result<Settled, CalibrateError> {
    let mut round = 0;
    loop {
        round += 1;
        state.take_motions();
        let mut adjustment = RigAdjustment::new(state)?;
        let adjusted = adjustment.solve_within(if round == 1 { FIRST_DECREASE } else { LAST_DECREASE })?;
        debug!("round {round}: {} iterations", adjusted.report.iterations);
        adjusted.give(state);
        let covariance = adjustment.covariance().map_err(|error| undetermined(error, state))?;
        // The motion of the first round is that of poses by single images.
        let is_still = state.cameras.iter().all(|camera| camera.offset_s.is_none());
        let (mut settled, mut dropped) = (round > 1 || is_still, 0);
        for (number, camera) in state.cameras.iter_mut().enumerate() {
            let used = camera.noise;
            let residuals = inverse_depth_residuals(camera, &adjusted.depth_residuals[number]);
            let redundancies = adjustment.redundancies(number, &covariance);
            estimate_noise(camera, &adjusted.image_residuals[number], &residuals, redundancies);
            settled &= has_settled(&used, camera, &residuals);
            if round < ROUNDS {
                let out = drop_outliers(camera, &residuals);
                camera.outliers += out;
                dropped += out;
            }
        }
        if (settled && dropped == 0) || round >= ROUNDS {
            let count: usize = adjusted.image_residuals.iter().chain(&adjusted.depth_residuals).map(Vec::len).sum();
            // Residuals far below any noise have nothing left to fall by.
            if adjusted.report.converged || adjusted.report.cost < 1e-6 * count as f64 {
                return Ok(Settled { adjustment, adjusted, covariance });
            }
            return Err(CalibrateError::NotConverged { reason: adjusted.report.termination.to_string() });
        }
    }
}

/// (predicted inverse depth, residual in inverse depth) of every sample, 1/mm, of residuals frame after frame.
pub(super) fn inverse_depth_residuals(camera: &CameraState, residuals: &[f64]) -> Vec<(f64, f64)> {
    let samples = camera.capture.frames.iter().flat_map(|f| f.samples.iter());
    samples.zip(residuals).map(|(s, r)| (1.0 / s.depth_mm + r, *r)).collect()
}

/// Variance components of a camera's markers and depth with redundancies from the covariance.
fn estimate_noise(camera: &mut CameraState, image: &[f64], depth: &[(f64, f64)], [of_image, of_depth]: [f64; 2]) {
    let inflation = |n: usize, redundancy: f64| n as f64 / redundancy.max(1.0);
    if !image.is_empty() {
        let sigma = clipped_sigma(image) * inflation(image.len(), of_image).sqrt();
        camera.noise.pixel_sigma = (camera.noise.pixel_sigma * sigma).max(LEAST_PIXEL_SIGMA);
    }
    if let Some(law) = DepthNoise::fit(depth, inflation(depth.len(), of_depth)) {
        camera.noise.depth = DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law };
    }
}

fn has_settled(used: &crate::observe::noise::NoiseModel, camera: &CameraState, depth: &[(f64, f64)]) -> bool {
    let change = |new: f64, used: f64| (new / used - 1.0).abs();
    let noise = &camera.noise;
    change(noise.pixel_sigma, used.pixel_sigma) < SETTLED[0]
        && depth.iter().all(|(rho, _)| change(noise.depth.sigma(*rho), used.depth.sigma(*rho)) < SETTLED[1])
}

/// Takes samples out that no noise explains; returns how many.
fn drop_outliers(camera: &mut CameraState, residuals: &[(f64, f64)]) -> usize {
    let depth = camera.noise.depth;
    let mut rest = residuals.iter();
    let mut dropped = 0;
    for frame in &mut camera.capture.frames {
        frame.retain_samples(|_| {
            let keep = rest.next().is_none_or(|(rho, r)| r.abs() <= OUTLIER * depth.sigma(*rho));
            dropped += usize::from(!keep);
            keep
        });
    }
    dropped
}

/// The error of a covariance, with the names of the parameters that take part.
fn undetermined(error: CovarianceError, state: &RigState) -> CalibrateError {
    let CovarianceError::RankDeficient { directions } = error else { return CalibrateError::Covariance(error) };
    let mut parameters: Vec<String> = Vec::new();
    for name in directions.iter().flat_map(|direction| named(direction, state)) {
        if !parameters.contains(&name) {
            parameters.push(name);
        }
    }
    CalibrateError::UndeterminedRig { combinations: directions.len(), parameters }
}

/// The parameters of a combination that move by a considerable part of what is usual for them, else its other variables.
fn named(direction: &NullDirection, state: &RigState) -> Vec<String> {
    let parameter = |label: &str, component: usize| -> Option<(String, f64)> {
        let (camera, block) = label.split_once('/')?;
        let camera: &Camera = &state.cameras.iter().find(|c| c.name == camera)?.camera;
        let parameter = camera.block(block)?.parameters().get(component)?;
        Some((format!("{label}.{}", parameter.name), parameter.scale))
    };
    let found = direction.components.iter().filter_map(|c| {
        let (name, scale) = parameter(&c.label, c.component)?;
        Some((name, c.value.abs() / scale))
    });
    let found: Vec<(String, f64)> = found.collect();
    let largest = found.iter().map(|f| f.1).fold(0.0, f64::max);
    if found.is_empty() {
        return direction.components.iter().map(|c| c.label.clone()).collect();
    }
    found.into_iter().filter(|f| f.1 > NAMED_SHARE * largest).map(|f| f.0).collect()
}
