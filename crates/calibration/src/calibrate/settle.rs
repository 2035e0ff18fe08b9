//! The one loop of every calibration: adjust, repair, estimate the noise, drop outliers, choose the smoothness of fields,
//! until nothing changes any more.

use depthcal_model::Camera;
use depthcal_solver::Covariance;
use depthcal_statistics::rms;
use tracing::debug;

use super::error::CalibrateError;
use super::explanation::explained;
use super::fitted::Calibrated;
use super::options::CalibrateOptions;
use super::residuals::{depth_residuals_mm, drop_outliers, inverse_depth_residuals};
use crate::adjust::adjustment::{Adjusted, Adjustment, Curvature};
use crate::adjust::depth_weight::less_predicts_better;
use crate::adjust::plane_scatter::{covariance_with_planes, plane_scatter};
use crate::adjust::smoothness_prior::Smoothness;
use crate::adjust::smoothness_selection;
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter, clipped_sigma};
use crate::observe::{AdjustableFrame, Capture, SampledFrame};

/// Rounds of adjustment and noise estimation.
pub(super) const ROUNDS: usize = 4;
/// Rounds in which the state is repaired: with the noise that was assumed, and with the one that was found.
const ROUNDS_WITH_REPAIR: usize = 2;
/// Relative change of a standard deviation below which the noise has settled.
const NOISE_SETTLED: f64 = 0.01;
/// … and of the frames' planes, whose scatter is known to some ten per cent at best.
const PLANES_SETTLED: f64 = 0.05;
/// Decrease of the cost by a step below which the first adjustment ends, before the noise is known. What is left is a tenth of that
/// or less: with the first value below two hundredths of a standard deviation of all parameters together …
const FIRST_DECREASE: f64 = 1e-3;
/// … and below five thousandths in later ones.
const LAST_DECREASE: f64 = 1e-4;
/// Markers are never taken for more precise than this, px: simulated ones may be exact.
const LEAST_PIXEL_SIGMA: f64 = 1e-4;
/// Nor is inverse depth, 1/mm: a micrometre at 1 m.
pub(super) const LEAST_INVERSE_DEPTH_SIGMA: f64 = 1e-9;

/// What the loop changes from round to round.
#[derive(Clone)]
pub(super) struct State<F> {
    /// Frames with their poses and samples.
    pub capture: Capture<F>,
    /// The camera.
    pub camera: Camera,
    /// The noise that weights the residuals.
    pub noise: NoiseModel,
    /// The prior of fields.
    pub smoothness: Smoothness,
}

/// How degrees of freedom are counted where variances are estimated from residuals.
pub(super) enum Freedom {
    /// From the covariance of the parameters: n − tr(J Σ Jᵀ).
    FromCovariance,
    /// By counting this many parameters of large fields, whose covariance is out of reach. Errs towards more noise.
    Counted(usize),
}

/// How often was adjusted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Attempt {
    /// Number of the round, from 1.
    pub round: usize,
    /// Repairs before this one.
    pub repairs: usize,
}

/// A repair of the state after an adjustment, given how often was adjusted; true where the round has to
/// begin anew. It is asked for in the first rounds: later ones hardly change the state.
pub(super) type Repair<'a, F> = &'a dyn Fn(Attempt, &mut State<F>, &Adjusted) -> Result<bool, CalibrateError>;

/// What a calibration does in each round.
pub(super) struct Rules<'a, F> {
    /// Whether depth samples take part.
    pub with_depth: bool,
    /// How degrees of freedom are counted.
    pub freedom: Freedom,
    /// Rounds up to this one drop outlying samples; the last round keeps them, so that the result belongs to them.
    pub last_to_drop: usize,
    /// Rounds after which the result is taken as it is.
    pub most_rounds: usize,
    /// Relative change of the depth noise below which it has settled.
    pub depth_noise_settled: f64,
    /// Whether the smoothness of fields is chosen from the data.
    pub chooses_smoothness: bool,
    /// What is looked after first in each round.
    pub repair: Repair<'a, F>,
}

/// Nothing to repair.
fn no_repair<F>(_: Attempt, _: &mut State<F>, _: &Adjusted) -> Result<bool, CalibrateError> {
    Ok(false)
}

/// The rules of a joint adjustment whose covariance can be had.
pub(super) fn joint_rules<'a>() -> Rules<'a, SampledFrame> {
    Rules {
        with_depth: true,
        freedom: Freedom::FromCovariance,
        last_to_drop: ROUNDS - 1,
        most_rounds: ROUNDS,
        depth_noise_settled: 2.0 * NOISE_SETTLED,
        chooses_smoothness: true,
        repair: &no_repair,
    }
}

/// Adjusts until noise, outliers and smoothness have settled.
///
/// # Errors
///
/// [`CalibrateError`] of the adjustment, of the repair, or where the last adjustment has not converged.
pub(super) fn settle<F: AdjustableFrame>(
    mut state: State<F>,
    rules: &Rules<'_, F>,
    options: &CalibrateOptions,
) -> Result<Calibrated<F>, CalibrateError> {
    // The choice of smoothness and the noise depend on each other.
    let chooses_smoothness = rules.chooses_smoothness && !state.smoothness.fields.is_empty();
    let most_rounds =
        if chooses_smoothness { rules.most_rounds.max(options.smoothness_rounds) } else { rules.most_rounds };
    let mut outliers = 0;
    // What a field leaves over while it is too smooth is no scatter of the frames, but would keep it smooth if it counted as one.
    let may_have_planes = options.frame_planes && rules.with_depth && !chooses_smoothness;
    // Whether depth weighs less than its samples would if frames had no planes of their own; decided once all else has settled.
    let mut weighs_less = if may_have_planes { None } else { Some(false) };
    let mut scatter = PlaneScatter::NONE;
    // Rounds that began anew after a repair estimate no noise and do not count.
    let (mut round, mut repairs) = (0, 0);
    loop {
        round += 1;
        let mut adjustment = Adjustment::new(&state.capture, &state.camera, &state.noise, rules.with_depth)
            .with_smoothness(&state.smoothness)
            .with_prior(options.prior.as_deref());
        let adjusted = adjustment.solve_within(if round == 1 { FIRST_DECREASE } else { LAST_DECREASE })?;
        debug!("round {round}: {} iterations", adjusted.report.iterations);
        state.camera = adjusted.camera.clone();
        state.capture.set_poses(&adjusted.poses);
        if round <= ROUNDS_WITH_REPAIR && (rules.repair)(Attempt { round, repairs }, &mut state, &adjusted)? {
            (round, repairs) = (round - 1, repairs + 1);
            continue;
        }
        let used = state.noise;
        let covariance = match rules.freedom {
            Freedom::FromCovariance => {
                let undetermined = |error| explained(error, &state.camera, &state.capture, rules.with_depth);
                Some(adjustment.covariance().map_err(undetermined)?)
            }
            Freedom::Counted(_) => None,
        };
        let residuals = inverse_depth_residuals(&state.capture, &adjusted.depth_residuals, &used);
        if weighs_less == Some(true) {
            scatter = plane_scatter(&state.capture, &state.camera, &used);
        }
        state.noise = estimate_noise(&used, &adjusted, &residuals, &adjustment, covariance.as_ref(), &rules.freedom);
        let dropped =
            if round <= rules.last_to_drop { drop_outliers(&mut state.capture, &residuals, &state.noise) } else { 0 };
        outliers += dropped;
        state.noise.planes = scatter;
        let noise_settled = has_settled(&used, &state.noise, &residuals, rules.depth_noise_settled)
            && planes_settled(&used.planes, &scatter);
        let mut smoothness_settled = true;
        if chooses_smoothness && round < most_rounds {
            let frames = adjustment.frame_information(Curvature::OfWeights, 1.0);
            let chosen = smoothness_selection::choose(&adjusted.camera, &state.smoothness, &frames);
            smoothness_settled = chosen.close_to(&state.smoothness);
            state.smoothness = chosen;
        }
        if (dropped == 0 && noise_settled && smoothness_settled) || round >= most_rounds {
            converged(&adjusted)?;
            if weighs_less.is_none() && !adjustment.by_node() {
                scatter = plane_scatter(&state.capture, &state.camera, &used);
                let less = scatter != PlaneScatter::NONE && less_predicts_better(&adjustment, scatter.design_effect);
                weighs_less = Some(less);
                if less {
                    (state.noise.planes, round) = (scatter, 0);
                    continue;
                }
                // They are reported all the same, and count in the covariance.
                state.noise.planes = PlaneScatter { design_effect: 1.0, ..scatter };
            }
            let covariance = covariance.map(|c| {
                let (capture, camera) = (&state.capture, &adjusted.camera);
                let of_noise = adjustment.camera_covariance(&c);
                covariance_with_planes(&adjustment, capture, camera, &used.depth, &scatter, &of_noise)
            });
            let depth_mm =
                rules.with_depth.then(|| depth_residuals_mm(&state.capture, &adjusted.depth_residuals, &used));
            return Ok(Calibrated {
                covariance,
                foreign_depth: Vec::new(),
                noise: state.noise,
                with_depth: rules.with_depth,
                correlation_length_px: None,
                outliers,
                lens_choice: None,
                lens_comparison: None,
                smoothness: state.smoothness,
                prior: options.prior.clone(),
                reprojection_rms_px: reprojection_rms(&state.capture, &adjusted, used.pixel_sigma),
                depth_rms_mm: depth_mm.map(rms),
                cost: adjusted.report.cost,
                iterations: adjusted.report.iterations,
                termination: adjusted.report.termination.to_string(),
                estimator: options.estimator,
                model: options.model.clone(),
                camera: adjusted.camera,
                capture: state.capture,
            });
        }
    }
}

/// Variance components of pixels and depth from the residuals of an adjustment that was weighted with `used`.
fn estimate_noise(
    used: &NoiseModel,
    adjusted: &Adjusted,
    depth_residuals: &[(f64, f64)],
    adjustment: &Adjustment,
    covariance: Option<&Covariance>,
    freedom: &Freedom,
) -> NoiseModel {
    let mut noise = *used;
    let depth_inflation = match (covariance, freedom) {
        (Some(covariance), _) => {
            let (image_redundancy, depth_redundancy) = adjustment.redundancies(covariance);
            let inflation = |n: usize, redundancy: f64| n as f64 / redundancy.max(1.0);
            let n = adjusted.image_residuals.len();
            noise.pixel_sigma *= clipped_sigma(&adjusted.image_residuals) * inflation(n, image_redundancy).sqrt();
            noise.pixel_sigma = noise.pixel_sigma.max(LEAST_PIXEL_SIGMA);
            inflation(depth_residuals.len(), depth_redundancy)
        }
        (None, Freedom::Counted(parameters)) => {
            let n = depth_residuals.len() as f64;
            n / (n - *parameters as f64).max(0.5 * n)
        }
        (None, Freedom::FromCovariance) => 1.0,
    };
    if let Some(law) = DepthNoise::fit(depth_residuals, depth_inflation) {
        noise.depth = DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law };
    }
    noise
}

/// Whether neither the pixels' nor, at any sample, the depth's standard deviation has changed by more than its tolerance.
fn has_settled(used: &NoiseModel, new: &NoiseModel, depth_residuals: &[(f64, f64)], depth_tolerance: f64) -> bool {
    let change = |new: f64, used: f64| (new / used - 1.0).abs();
    change(new.pixel_sigma, used.pixel_sigma) < NOISE_SETTLED
        && depth_residuals
            .iter()
            .all(|(rho, _)| change(new.depth.sigma(*rho), used.depth.sigma(*rho)) < depth_tolerance)
}

/// Whether the scatter of the frames' planes has changed by no more than [`PLANES_SETTLED`].
fn planes_settled(used: &PlaneScatter, new: &PlaneScatter) -> bool {
    (used.design_effect - new.design_effect).abs() <= PLANES_SETTLED * new.design_effect
}

fn converged(adjusted: &Adjusted) -> Result<(), CalibrateError> {
    // Residuals far below any noise have nothing left to fall by: exact observations, where rounding hides the descent.
    let residuals = (adjusted.image_residuals.len() + adjusted.depth_residuals.len()) as f64;
    if adjusted.report.converged || adjusted.report.cost < 1e-6 * residuals {
        return Ok(());
    }
    Err(CalibrateError::NotConverged { reason: adjusted.report.termination.to_string() })
}

/// Root mean square distance between markers and their projections, px.
fn reprojection_rms<F: AdjustableFrame>(capture: &Capture<F>, adjusted: &Adjusted, pixel_sigma: f64) -> f64 {
    let stds = capture.frames.iter().flat_map(|f| f.posed().markers.iter().map(|m| m.std_px * pixel_sigma));
    let squares = adjusted.image_residuals.chunks_exact(2).zip(stds);
    let (sum, n) = squares.fold((0.0, 0), |(s, n), (r, std)| (s + (r[0] * r[0] + r[1] * r[1]) * std * std, n + 1));
    (sum / f64::from(n.max(1))).sqrt()
}
