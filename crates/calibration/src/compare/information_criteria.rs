//! Effective number of parameters, AIC and BIC of fits, all on the same observations.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use crate::calibrate::{CalibratedCamera, Estimator};
use crate::observe::board_plane::BoardPlane;
use crate::observe::noise::NoiseModel;

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

/// The residuals of a joint adjustment at what it was fitted to.
pub(super) struct Residuals {
    effective: f64,
    noise: NoiseModel,
    frames: Vec<FrameResiduals>,
}

/// The residuals of a frame.
struct FrameResiduals {
    name: String,
    /// Number of every marker, and its squared reprojection error, px².
    markers: Vec<([u32; 2], f64)>,
    /// Pixel of every depth sample, its predicted inverse depth and predicted minus measured, 1/mm.
    depths: Vec<([u32; 2], [f32; 2])>,
}

impl Residuals {
    /// Those of a joint adjustment with depth, which has so many effective parameters; `None` of other estimators.
    pub fn of(fitted: &CalibratedCamera, effective: f64) -> Option<Self> {
        if fitted.estimator != Estimator::Joint || !fitted.with_depth {
            return None;
        }
        let (camera, target) = (&fitted.camera, &fitted.capture.target);
        let frame = |frame: &crate::observe::SampledFrame| {
            let plane = BoardPlane::new(&frame.camera_from_board);
            let marker = |marker: &crate::observe::MarkerObservation| {
                let point = Point3::from(camera.board_point(target.point(marker.index)));
                let [u, v] = camera.project(&(frame.camera_from_board * point).coords)?;
                let error = ((u - marker.pixel[0]).powi(2) + (v - marker.pixel[1]).powi(2)) / marker.std_px.powi(2);
                Some(([marker.index as u32, 0], error))
            };
            let depth = |sample: &crate::observe::DepthSample| {
                let measured = 1.0 / sample.depth_mm;
                let [u, v] = sample.context.pixel;
                let ray = camera.ray([u, v], measured).ok()?;
                let [.., rho, cosine] = plane.depth_state(ray)?;
                let predicted = camera.measured_inverse_depth(&sample.context, ray, cosine, rho);
                let values = [predicted as f32, (predicted - measured) as f32];
                values.iter().all(|v| v.is_finite()).then_some(([u as u32, v as u32], values))
            };
            FrameResiduals {
                name: frame.name.clone(),
                markers: frame.markers.iter().filter_map(marker).collect(),
                depths: frame.samples.iter().filter_map(depth).collect(),
            }
        };
        let frames = fitted.capture.frames.iter().map(frame).collect();
        Some(Self { effective, noise: fitted.noise, frames })
    }

    /// Takes out what is not in all of the others.
    fn retain_common(&mut self, others: &[BTreeMap<String, [BTreeSet<[u32; 2]>; 2]>]) {
        for frame in &mut self.frames {
            let in_all = |key: [u32; 2], kind: usize| {
                others.iter().all(|fit| fit.get(&frame.name).is_some_and(|keys| keys[kind].contains(&key)))
            };
            frame.depths.retain(|(pixel, _)| in_all(*pixel, 0));
            frame.markers.retain(|(number, _)| in_all(*number, 1));
        }
    }

    /// Pixels of the depth samples and numbers of the markers of every frame.
    fn observations(&self) -> BTreeMap<String, [BTreeSet<[u32; 2]>; 2]> {
        let keys = |frame: &FrameResiduals| {
            [frame.depths.iter().map(|(p, _)| *p).collect(), frame.markers.iter().map(|(n, _)| *n).collect()]
        };
        self.frames.iter().map(|frame| (frame.name.clone(), keys(frame))).collect()
    }

    /// −2 ln L under a noise model, up to a constant, and the number of rows.
    fn deviance(&self, noise: &NoiseModel) -> (f64, f64) {
        let (mut deviance, mut rows) = (0.0, 0.0);
        for frame in &self.frames {
            for (_, values) in &frame.depths {
                let [rho, residual] = values.map(f64::from);
                let sigma = noise.depth.sigma(rho);
                deviance += (residual / sigma).powi(2) + 2.0 * sigma.ln();
                rows += 1.0;
            }
            for (_, squared) in &frame.markers {
                deviance += squared / noise.pixel_sigma.powi(2) + 4.0 * noise.pixel_sigma.ln();
                rows += 2.0;
            }
        }
        (deviance, rows)
    }
}

/// AIC (Akaike 1974), −2 ln L + 2 k, and BIC (Schwarz 1978), −2 ln L + k ln n, of joint adjustments by their numbers, as
/// differences from the least.
///
/// All are judged on the observations that all were fitted to, and by the noise of the likeliest of them: with outliers and noise
/// of its own, a fit that leaves more out, or calls more of it noise, would seem better than one that contains it. Residuals are
/// taken as independent; pixels of a frame are correlated, so both favour large models.
pub(super) fn criteria(mut fits: BTreeMap<usize, Residuals>) -> BTreeMap<usize, [f64; 2]> {
    let observations: Vec<_> = fits.values().map(Residuals::observations).collect();
    fits.values_mut().for_each(|fit| fit.retain_common(&observations));
    let by_its_noise = |fit: &Residuals| fit.deviance(&fit.noise).0;
    let likeliest = fits.values().min_by(|a, b| by_its_noise(a).total_cmp(&by_its_noise(b)));
    let Some(noise) = likeliest.map(|fit| fit.noise) else { return BTreeMap::new() };
    let of_fit = |fit: &Residuals| {
        let (deviance, rows) = fit.deviance(&noise);
        [2.0, rows.ln()].map(|penalty| deviance + penalty * fit.effective)
    };
    let criteria: BTreeMap<usize, [f64; 2]> = fits.iter().map(|(number, fit)| (*number, of_fit(fit))).collect();
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
        let residuals = fits.iter().zip(&effective).map(|(fit, effective)| Residuals::of(fit, *effective).unwrap());
        let criteria = criteria(residuals.enumerate().collect());
        let rows: usize = fits[0].capture.frames.iter().map(|f| f.samples.len() + 2 * f.markers.len()).sum();
        assert!(criteria[&0][1] > 100.0, "the true model is better: {criteria:?}");
        for (kind, penalty) in [(0, 2.0), (1, (rows as f64).ln())] {
            let worse = criteria[&2][kind] - criteria[&1][kind];
            // The larger one fits at least as well, but for what weights and losses of the two fits differ.
            assert!(worse < penalty * (effective[2] - effective[1]) + 1.0, "{criteria:?}");
        }
    }
}
