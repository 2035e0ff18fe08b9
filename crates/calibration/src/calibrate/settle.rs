//! The one loop of every calibration, of one camera or a rig: adjust, repair, estimate the noise, drop outliers, choose the
//! smoothness of fields, until nothing changes any more.

use depthcal_solver::Covariance;
use nalgebra::DMatrix;
use tracing::{debug, info};

use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::explanation::explained;
use super::residuals::{DepthResidual, depth_residuals, drop_outliers};
use super::rounds::Rounds;
use super::rules::{Attempt, Freedom, NOISE_SETTLED, Rules};
use crate::adjust::adjustment::{Adjusted, AdjustedCamera, Adjustment};
use crate::adjust::frame_information::Curvature;
use crate::adjust::plane_scatter::covariance_with_planes;
use crate::adjust::smoothness_selection;
use crate::adjust::state::State;
use crate::observe::AdjustableFrame;
use crate::observe::noise::{DepthNoise, NoiseModel, clipped_sigma, fit_depth_noise};

/// Rounds in which the state is repaired: with the noise that was assumed, and with the one that was found.
const ROUNDS_WITH_REPAIR: usize = 2;
/// Decrease of the cost by a step below which the first adjustment ends, before the noise is known. What is left is a tenth of
/// that or less: with the first value below two hundredths of a standard deviation of all parameters together …
const FIRST_DECREASE: f64 = 1e-3;
/// … and below five thousandths in later ones.
const LAST_DECREASE: f64 = 1e-4;
/// Markers are never taken for more precise than this, px: simulated ones may be exact.
const LEAST_PIXEL_SIGMA: f64 = 1e-4;
/// Nor is inverse depth, 1/mm: a micrometre at 1 m.
pub(super) const LEAST_INVERSE_DEPTH_SIGMA: f64 = 1e-9;

/// A settled adjustment: the state is that of its last adjustment.
pub(super) struct Settled<F> {
    /// Cameras, frames, noise.
    pub state: State<F>,
    /// The last adjustment.
    pub adjusted: Adjusted,
    /// The noise of every camera that weighted its residuals.
    pub weighted_by: Vec<NoiseModel>,
    /// Joint covariance of the cameras' parameters, in the order of [`Adjustment::variables`]; zero for held parameters. `None`
    /// where it is out of reach.
    pub covariance: Option<DMatrix<f64>>,
    /// Whether depth samples took part.
    pub with_depth: bool,
}

/// Adjusts until noise, outliers and smoothness have settled.
///
/// # Errors
///
/// [`CalibrateError`] of the adjustment, of the repair, or where the last adjustment has not converged.
pub(super) fn settle<F: AdjustableFrame>(
    mut state: State<F>,
    rules: &Rules<'_, F>,
    options: &CameraOptions,
) -> Result<Settled<F>, CalibrateError> {
    let mut rounds = Rounds::new(&state, rules, options);
    loop {
        rounds.number += 1;
        state.take_motions();
        let mut adjustment = Adjustment::of_state(&state, rules.with_depth)?;
        let adjusted = match rounds.number {
            // Images alone start from homographies; depth starts from images, or from a fit before.
            1 if !rules.with_depth => adjustment.solve_within(FIRST_DECREASE),
            1 => adjustment.refine_within(FIRST_DECREASE),
            _ => adjustment.refine_within(LAST_DECREASE),
        }?;
        debug!("round {}: {} iterations", rounds.number, adjusted.report.iterations);
        adjusted.give(&mut state);
        if rounds.number <= ROUNDS_WITH_REPAIR && repaired(&mut state, rules, rounds.attempt(), &adjusted)? {
            rounds.begin_anew();
            continue;
        }
        let weighted_by: Vec<NoiseModel> = state.cameras.iter().map(|camera| camera.noise).collect();
        let covariance = match rules.freedom {
            Freedom::FromCovariance => {
                let undetermined = |error| explained(error, &state, &adjustment, rules.with_depth);
                Some(adjustment.covariance().map_err(undetermined)?)
            }
            Freedom::Counted(_) => None,
        };
        rounds.measure_planes(&state, &weighted_by);
        // The motion of the first round is that of poses by single images.
        let is_still = state.cameras.iter().all(|camera| camera.offset_s.is_none());
        let mut settled = rounds.number > 1 || is_still;
        for number in 0..state.cameras.len() {
            let parts = (&adjustment, &adjusted.cameras[number], covariance.as_ref());
            settled &= update_noise(&mut state, number, parts, rules, &rounds);
        }
        settled &= choose_smoothness(&mut state, &adjustment, &mut rounds);
        if settled || rounds.number >= rounds.most {
            if !adjusted.has_converged() {
                return Err(CalibrateError::NotConverged { reason: adjusted.report.termination.to_string() });
            }
            if rounds.chooses_smoothness && rounds.number >= rounds.most {
                info!("the smoothness of the fields has not settled after {} rounds", rounds.number);
            }
            if rounds.decide_depth_weights(&mut state, &weighted_by, &adjustment) {
                continue;
            }
            let covariance = covariance.map(|c| with_planes(&adjustment, &state, &weighted_by, &rounds, &c));
            return Ok(Settled { state, adjusted, weighted_by, covariance, with_depth: rules.with_depth });
        }
    }
}

/// Mends the only camera of a state by the rules' repair; whether anything was mended.
fn repaired<F: AdjustableFrame>(
    state: &mut State<F>,
    rules: &Rules<'_, F>,
    attempt: Attempt,
    adjusted: &Adjusted,
) -> Result<bool, CalibrateError> {
    let (Some(repair), [camera]) = (rules.repair, &mut state.cameras[..]) else { return Ok(false) };
    let changed = repair(attempt, camera, &adjusted.cameras[0])?;
    // Markers may have gone even where the round does not begin anew.
    state.take_frames();
    Ok(changed)
}

/// Estimates the noise of a camera from its residuals and drops its outliers; whether both have settled.
fn update_noise<F: AdjustableFrame>(
    state: &mut State<F>,
    number: usize,
    (adjustment, adjusted, covariance): (&Adjustment, &AdjustedCamera, Option<&Covariance>),
    rules: &Rules<'_, F>,
    rounds: &Rounds,
) -> bool {
    let camera = &mut state.cameras[number];
    let used = camera.noise;
    let residuals = depth_residuals(camera, adjusted);
    let redundancies = covariance.map(|covariance| adjustment.redundancies(number, covariance));
    camera.noise = estimate_noise(&used, &adjusted.image_residuals, &residuals, redundancies, &rules.freedom);
    let noise = camera.noise;
    let dropped = if rounds.number <= rules.last_to_drop { drop_outliers(camera, &residuals, &noise) } else { 0 };
    camera.outliers += dropped;
    camera.noise.planes = rounds.planes_in_weights(number);
    dropped == 0
        && has_settled(&used, &camera.noise, &residuals, rules.depth_noise_settled)
        && Rounds::planes_settled(&used.planes, &camera.noise.planes)
}

/// Variance components of pixels and depth from the residuals of an adjustment that was weighted with `used`, given the
/// redundancies of both (Förstner 1979).
fn estimate_noise(
    used: &NoiseModel,
    image_residuals: &[f64],
    depth_residuals: &[DepthResidual],
    redundancies: Option<[f64; 2]>,
    freedom: &Freedom,
) -> NoiseModel {
    let mut noise = *used;
    let depth_inflation = match (redundancies, freedom) {
        (Some([of_image, of_depth]), _) => {
            let inflation = |n: usize, redundancy: f64| n as f64 / redundancy.max(1.0);
            let n = image_residuals.len();
            if n > 0 {
                noise.pixel_sigma *= clipped_sigma(image_residuals) * inflation(n, of_image).sqrt();
                noise.pixel_sigma = noise.pixel_sigma.max(LEAST_PIXEL_SIGMA);
            }
            inflation(depth_residuals.len(), of_depth)
        }
        (None, Freedom::Counted(parameters)) => {
            let n = depth_residuals.len() as f64;
            n / (n - *parameters as f64).max(0.5 * n)
        }
        (None, Freedom::FromCovariance) => 1.0,
    };
    let samples: Vec<(f64, f64)> = depth_residuals.iter().map(|r| (r.rho, r.residual)).collect();
    if let Some(law) = fit_depth_noise(&samples, depth_inflation) {
        noise.depth = DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law };
    }
    noise
}

/// Whether neither the pixels' nor, at any sample, the depth's standard deviation has changed by more than its tolerance.
fn has_settled(used: &NoiseModel, new: &NoiseModel, residuals: &[DepthResidual], depth_tolerance: f64) -> bool {
    let change = |new: f64, used: f64| (new / used - 1.0).abs();
    change(new.pixel_sigma, used.pixel_sigma) < NOISE_SETTLED
        && residuals.iter().all(|r| change(new.depth.sigma(r.rho), used.depth.sigma(r.rho)) < depth_tolerance)
}

/// Chooses the smoothness of all fields where it is chosen from the data; whether it has settled.
fn choose_smoothness<F: AdjustableFrame>(state: &mut State<F>, adjustment: &Adjustment, rounds: &mut Rounds) -> bool {
    if !rounds.chooses_smoothness || rounds.number >= rounds.most {
        return true;
    }
    let mut settled = true;
    for number in 0..state.cameras.len() {
        let camera = &mut state.cameras[number];
        if camera.smoothness.fields.is_empty() {
            continue;
        }
        let frames = adjustment.frame_information_of_camera(number, Curvature::OfWeights);
        let chosen = smoothness_selection::choose(&camera.camera, &camera.smoothness, &frames);
        if rounds.is_flat_again(number, &camera.smoothness, &chosen) {
            continue;
        }
        settled &= chosen.close_to(&camera.smoothness);
        camera.smoothness = chosen;
    }
    settled
}

/// The joint covariance of the cameras' parameters with what the planes of their frames add.
fn with_planes<F: AdjustableFrame>(
    adjustment: &Adjustment,
    state: &State<F>,
    weighted_by: &[NoiseModel],
    rounds: &Rounds,
    covariance: &Covariance,
) -> DMatrix<f64> {
    let of_noise = adjustment.camera_covariance(covariance);
    (0..state.cameras.len()).fold(of_noise, |sum, number| {
        let (noise, planes) = (&weighted_by[number].depth, rounds.planes(number));
        covariance_with_planes(adjustment, (state, number), noise, planes, &sum)
    })
}
