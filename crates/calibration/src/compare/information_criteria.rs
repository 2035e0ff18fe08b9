//! Effective number of parameters, AIC and BIC of fits, all on the same observations.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_solver::Loss;
use rayon::prelude::*;

use crate::adjust::adjustment::{AdjustedCamera, Adjustment};
use crate::adjust::leave_out::DECREASE;
use crate::adjust::observations::HUBER;
use crate::adjust::state::{CameraState, State};
use crate::calibrate::{CalibratedCamera, Estimator};
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, DepthSample, SampledFrame};

/// Number of free parameters of camera, lens and depth model; of fields only the effective number, tr(Σ N), which the data
/// rather than the smoothness prior determine.
pub(super) fn effective_parameters(fitted: &CalibratedCamera) -> f64 {
    let fields = &fitted.smoothness.fields;
    let blocks = fitted.camera.blocks().iter().map(|block| {
        let free = block.free.iter().filter(|f| **f).count() as f64;
        let fields_of_block = fields.iter().filter(|f| f.piece == block.name());
        fields_of_block.fold(free, |count, f| count - f.nodes as f64 + f.effective.unwrap_or(f.nodes as f64))
    });
    blocks.sum()
}

/// A joint adjustment with what it was fitted to.
pub(super) struct JointFit {
    effective: f64,
    state: CameraState<SampledFrame>,
}

/// The pixels of the depth samples and the numbers of the markers of every frame.
type Observations = BTreeMap<String, [BTreeSet<[u32; 2]>; 2]>;

impl JointFit {
    /// A joint adjustment with depth, which has so many effective parameters; `None` of other estimators.
    pub fn of(fit: &CalibratedCamera, effective: f64) -> Option<Self> {
        let (smoothness, prior) = (fit.smoothness.clone(), fit.prior.clone());
        let state = CameraState::reference(fit.capture.clone(), fit.camera.clone(), fit.noise);
        let is_joint = fit.estimator == Estimator::Joint && fit.with_depth;
        is_joint.then_some(Self { effective, state: CameraState { smoothness, prior, ..state } })
    }

    /// The noise that weighted its residuals.
    pub fn noise(&self) -> NoiseModel {
        self.state.noise
    }

    /// Takes out what is not in all of the others.
    fn retain_common(&mut self, others: &[Observations]) {
        for frame in &mut self.state.capture.frames {
            let name = frame.name.clone();
            let in_all = |key: [u32; 2], kind: usize| {
                others.iter().all(|fit| fit.get(&name).is_some_and(|keys| keys[kind].contains(&key)))
            };
            frame.retain_samples(|sample| in_all(key_of(sample), 0));
            frame.markers.retain(|marker| in_all([marker.index as u32, 0], 1));
        }
        self.state.capture.frames.retain(|frame| !frame.markers.is_empty());
    }

    fn observations(&self) -> Observations {
        let keys = |frame: &SampledFrame| {
            let samples = frame.samples.iter().map(key_of).collect();
            let markers = frame.markers.iter().map(|marker| [marker.index as u32, 0]).collect();
            (frame.name.clone(), [samples, markers])
        };
        self.state.capture.frames.iter().map(keys).collect()
    }

    /// AIC and BIC of the model, adjusted again with the weights that `noise` gives; `None` where the adjustment fails.
    fn criteria(self, noise: &NoiseModel) -> Option<[f64; 2]> {
        let state = State::of_camera(CameraState { noise: *noise, ..self.state });
        let adjusted = Adjustment::of_state(&state, true).ok()?.refine_within(DECREASE).ok()?;
        let AdjustedCamera { image_residuals, depth_residuals, .. } = adjusted.cameras.first()?;
        let loss = Loss::Huber { delta: HUBER };
        // The samples of a frame are not independent: together they count as fewer.
        let weight = 1.0 / noise.planes.design_effect;
        let of_markers: f64 = image_residuals.chunks(2).map(|r| loss.evaluate(r.iter().map(|r| r * r).sum())[0]).sum();
        let of_depth: f64 = depth_residuals.iter().map(|r| loss.evaluate(r * r)[0]).sum();
        let rows = image_residuals.len() as f64 + weight * depth_residuals.len() as f64;
        Some([2.0, rows.ln()].map(|penalty| of_markers + weight * of_depth + penalty * self.effective))
    }
}

fn key_of(sample: &DepthSample) -> [u32; 2] {
    sample.context.pixel.map(|c| c as u32)
}

/// AIC (Akaike 1974), −2 ln L + 2 k, and BIC (Schwarz 1978), −2 ln L + k ln n, of joint adjustments by their numbers, as
/// differences from the least.
///
/// All are adjusted again to the observations that all were fitted to, with the weights that one `noise` gives, and −2 ln L is
/// the least sum of losses, so that no model is worse than one that it contains: with outliers, noise and a weight of depth of
/// its own, a fit that leaves more out, or calls more of it noise, would seem better.
pub(super) fn criteria(mut fits: BTreeMap<usize, JointFit>, noise: &NoiseModel) -> BTreeMap<usize, [f64; 2]> {
    let observations: Vec<_> = fits.values().map(JointFit::observations).collect();
    fits.values_mut().for_each(|fit| fit.retain_common(&observations));
    let of_fit = |(number, fit): (usize, JointFit)| Some((number, fit.criteria(noise)?));
    let criteria: BTreeMap<usize, [f64; 2]> = fits.into_par_iter().filter_map(of_fit).collect();
    let least = [0, 1].map(|kind| criteria.values().map(|c| c[kind]).fold(f64::INFINITY, f64::min));
    criteria.into_iter().map(|(number, c)| (number, [c[0] - least[0], c[1] - least[1]])).collect()
}

#[cfg(test)]
mod tests {
    use depthcal_model::PieceSpec;
    use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CameraOptions, calibrate_camera};
    use crate::simulated;

    /// The smaller model takes what it cannot say for outliers and for noise. By its own observations and noise it would be the
    /// better one.
    #[test]
    fn a_model_does_not_lose_to_one_that_it_contains() {
        let effects = [Effect::new("quadratic_depth", 8.0).unwrap()];
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &effects, 7);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let fit = |models: &[&str]| {
            let effects: Vec<PieceSpec> = models.iter().map(|name| PieceSpec::new(*name)).collect();
            let options = CameraOptions { effects, ..CameraOptions::default() };
            calibrate_camera(&capture, &options).expect("a fit")
        };
        let fits = [fit(&[]), fit(&["quadratic_depth"]), fit(&["quadratic_depth", "range_offset"])];
        let effective: Vec<f64> = fits.iter().map(effective_parameters).collect();
        let joint = fits.iter().zip(&effective).map(|(fit, effective)| JointFit::of(fit, *effective).unwrap());
        let criteria = criteria(joint.enumerate().collect(), &fits[1].noise);
        let rows: usize = fits[0].capture.frames.iter().map(|f| f.samples.len() + 2 * f.markers.len()).sum();
        assert!(criteria[&0][1] > 100.0, "the true model is better: {criteria:?}");
        for (kind, penalty) in [(0, 2.0), (1, (rows as f64).ln())] {
            let worse = criteria[&2][kind] - criteria[&1][kind];
            // The larger one fits at least as well, but for the end of the adjustment.
            assert!(worse < penalty * (effective[2] - effective[1]) + 1.0, "{criteria:?}");
        }
    }
}
