//! Fits models to the frames of a capture, each from the one before.

use std::cell::RefCell;

use depthcal_model::hook::HookKind;
use depthcal_model::{Modulation, PieceSpec, Register};
use depthcal_solver::score::ScoreError;
use tracing::{debug, info};

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::known_searches::KnownSearches;
use super::refinement::refined;
use crate::calibrate::{
    CalibrateError, CalibratedCamera, CameraOptions, calibrate_keeping_samples, has_fields, image_blocks,
    light_of_samples, readjust, sampled_under,
};
use crate::diagnose::discovery::{self, Chance, Component, OfCovariates, Search, additive_components};
use crate::diagnose::examination::{EffectTest, Examination, examine, test_effect};
use crate::diagnose::held_out::HeldOut;
use crate::diagnose::options::CameraDiagnoseOptions;
use crate::judge::camera::evaluate_camera;
use crate::judge::cross_validation::{cross_validate_thinned, errors};
use crate::judge::parts::Parts;
use crate::observe::{CameraFrames, SampledFrame};
use crate::progress::Job;

/// Most board pixels of a frame, about, on which models are judged with frames left out singly: at least so many, and …
const JUDGED_PIXELS: usize = 2000;
/// … for every marker so many, of which some lie close enough to it to tell its depth.
const JUDGED_PIXELS_OF_A_MARKER: usize = 40;
/// With frames left out in blocks, which only decides.
const JUDGED_PIXELS_OF_BLOCKS: usize = 1000;

/// Fits models to frames of a capture. Every fit starts from the last one that has the same effects in the images, with its known
/// samples, so that the results depend on the order of fits.
pub(super) struct Fitter<'a> {
    /// All frames that may be fitted.
    pub whole: CameraFrames,
    /// Another dataset that verifies the model; without it held-out errors come from cross-validation.
    verify: Option<&'a CameraFrames>,
    /// Declared model, folds and thresholds.
    options: &'a CameraDiagnoseOptions,
    job: Box<dyn Job>,
    /// One for every set of effects in the images, and of frequencies of the light.
    bases: RefCell<Vec<Basis>>,
    searches: KnownSearches,
}

impl<'a> Fitter<'a> {
    /// A fitter that has fitted nothing yet.
    pub fn new(whole: CameraFrames, verify: Option<&'a CameraFrames>, options: &'a CameraDiagnoseOptions) -> Self {
        let job = options.calibrate.progress.open_ended("diagnosing");
        Self { whole, verify, options, job, bases: RefCell::default(), searches: KnownSearches::default() }
    }

    /// Fits to some of the frames, in a round of the loop; 0 is before the first.
    pub fn on<'s>(&'s self, frames: &'s CameraFrames, round: usize) -> OnFrames<'s> {
        OnFrames { fitter: self, frames, round }
    }
}

/// Fits and judges models on the frames that are used in a round.
#[derive(Clone, Copy)]
pub(super) struct OnFrames<'s> {
    fitter: &'s Fitter<'s>,
    frames: &'s CameraFrames,
    round: usize,
}

/// The start of fits.
struct Basis {
    /// All frames that a fit has used, with their depth samples, before any were left out as outliers of a model.
    samples: CameraFrames<SampledFrame>,
    /// The last fit.
    last: CalibratedCamera,
    /// Modulation frequencies for which the samples have the light of their frames.
    light: Option<Modulation>,
    /// Names of the effects of its model that images show. What images alone decide, above all the order of the lens, is decided
    /// with these effects.
    in_images: Vec<String>,
}

impl Basis {
    /// The samples of the frames of a capture; `None` where it has frames that were never sampled.
    fn samples_of(&self, capture: &CameraFrames) -> Option<CameraFrames<SampledFrame>> {
        let (frames, dropped) = (&self.samples.frames, &self.samples.dropped);
        let known = |name: &str| frames.iter().any(|f| f.name == name) || dropped.iter().any(|d| d.name == name);
        let wanted = |name: &str| capture.frames.iter().any(|f| f.name == name);
        capture.frames.iter().all(|f| known(&f.name)).then(|| self.samples.subset(|_, f| wanted(&f.name)))
    }
}

impl OnFrames<'_> {
    /// Names of the effects by which the depth image seems to be displaced, among all that may be missing: they shift what depth
    /// depends on.
    fn displacements(&self, fit: &CalibratedCamera) -> Vec<&'static str> {
        let register = &self.declared().register;
        let missing: Vec<&str> = register.names().filter(|name| fit.camera.block(name).is_none()).collect();
        let is_displacement =
            |name: &&str| register.block(name, None).is_ok_and(|block| block.hook() == HookKind::Pixel);
        let seems_there = |name: &&str| {
            let test = test_effect(fit, register, &PieceSpec::new(*name));
            let p_value = test.map_or(1.0, |test| test.score.clustered_p_value);
            debug!("{name}: p = {p_value:.2e} by the scatter between frames");
            p_value * (missing.len() as f64) < self.thresholds().level
        };
        missing.iter().copied().filter(is_displacement).filter(seems_there).collect()
    }

    /// The frames that verify, sampled under the camera of a fit; `None` where there are none, or none that show depth.
    fn verify_under(&self, fit: &CalibratedCamera) -> Option<CalibratedCamera> {
        let sampled = sampled_under(fit, self.fitter.verify?, self.declared());
        sampled.inspect_err(|error| info!("frames that verify cannot be sampled: {error}")).ok()
    }
}

impl Bench for OnFrames<'_> {
    fn options(&self) -> &CameraDiagnoseOptions {
        self.fitter.options
    }

    fn report(&self, what: &str, model: &CameraOptions) {
        let added = model.effects.get(self.declared().effects.len()..).unwrap_or_default();
        let words: Vec<String> = added.iter().map(|spec| model.register.words(spec)).collect();
        let model = if words.is_empty() { "the declared model".to_owned() } else { words.join(" + ") };
        match self.round {
            0 => self.fitter.job.doing(format!("diagnosing: {what} ({model})")),
            round => self.fitter.job.doing(format!("diagnosing, round {round}: {what} ({model})")),
        }
    }

    /// The first fit with some effects in the images decides the order of the lens and the gross markers, and samples the depth;
    /// later ones with the same effects in the images start from the one before, with the same samples.
    fn fit(&self, model: &CameraOptions) -> Result<CalibratedCamera, CalibrateError> {
        self.report("fitting", model);
        let mut bases = self.fitter.bases.borrow_mut();
        let light = light_of_samples(model)?;
        let in_images: Vec<String> = image_blocks(model)?.iter().map(|block| block.name().to_owned()).collect();
        let place = bases.iter().position(|basis| basis.light == light && basis.in_images == in_images);
        if let Some(basis) = place.filter(|_| !has_fields(model).unwrap_or(false)).map(|place| &mut bases[place])
            && let Some(samples) = basis.samples_of(self.frames)
        {
            match readjust(&basis.last, samples, model) {
                Ok(fit) => {
                    basis.last = fit.clone();
                    return Ok(fit);
                }
                Err(error @ CalibrateError::Undetermined(_)) => return Err(error),
                Err(error) => info!("from an earlier fit: {error}; fitted from the start"),
            }
        }
        let (fit, samples) = calibrate_keeping_samples(self.frames, model)?;
        let basis = Basis { samples, last: fit.clone(), light, in_images };
        match place {
            Some(place) => bases[place] = basis,
            None => bases.push(basis),
        }
        Ok(fit)
    }

    fn held_out(&self, fit: &CalibratedCamera, model: &CameraOptions) -> Result<HeldOut, CalibrateError> {
        self.report("judging on held-out frames", model);
        let folds = self.options().folds.min(fit.capture.frames.len());
        let (evaluated, blocks) = match self.fitter.verify {
            Some(verify) => (evaluate_camera(&fit.camera, verify), None),
            None => {
                // Models with fields are fitted anew without each part: once has to do.
                let blocks = match has_fields(model)? {
                    true => None,
                    false => Some(cross_validate_thinned(fit, folds, Parts::Blocks, JUDGED_PIXELS_OF_BLOCKS, model)?),
                };
                let of_markers = JUDGED_PIXELS_OF_A_MARKER * fit.capture.target.len();
                let most = JUDGED_PIXELS.max(of_markers);
                (cross_validate_thinned(fit, folds, Parts::Interleaved, most, model)?, blocks)
            }
        };
        Ok(HeldOut { errors: errors(&evaluated), evaluated: evaluated.into(), blocks: blocks.map(Into::into) })
    }

    fn refined(&self, model: AugmentedModel) -> Result<(AugmentedModel, Fitted), CalibrateError> {
        refined(self, model)
    }

    fn examine(&self, fit: &CalibratedCamera) -> Result<Examination, ScoreError> {
        examine(fit, &self.declared().register, self.thresholds())
    }

    fn test(&self, fit: &CalibratedCamera, register: &Register, effect: &PieceSpec) -> Option<EffectTest> {
        test_effect(fit, register, effect)
    }

    fn components(&self, fit: &CalibratedCamera, taken: &[String]) -> Vec<Component> {
        let register = &self.declared().register;
        let search = || additive_components(fit, register, &self.displacements(fit), taken);
        self.fitter.searches.components(fit, taken, search)
    }

    fn discover(
        &self,
        fit: &CalibratedCamera,
        chance: Chance<'_>,
        examination: &Examination,
        taken: &[String],
    ) -> Search {
        let verify = self.verify_under(fit);
        discovery::search(fit, chance, verify.as_ref(), examination, taken, self.thresholds())
    }

    fn formula_of(
        &self,
        covariates: &[String],
        fit: &CalibratedCamera,
        examination: &Examination,
        taken: &[String],
    ) -> Option<OfCovariates> {
        let verify = self.verify_under(fit);
        discovery::search_of(covariates, fit, verify.as_ref(), examination, taken, self.thresholds())
    }
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::calibrate_camera;
    use crate::simulated;

    /// A bent board hides terms of the lens, which a model with the bend has again; and the declared model is what it was.
    #[test]
    fn the_lens_is_that_of_a_calibration_with_the_same_effects() {
        let bow = Effect::new("board_bow", 2.5).unwrap();
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[bow], 3).frames(24);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let options = CameraDiagnoseOptions::default();
        let mut with_bow = options.calibrate.clone();
        with_bow.effects.push(PieceSpec::new("board_bow"));
        let fitter = Fitter::new(capture.clone(), None, &options);
        let bench = fitter.on(&capture, 1);
        let lens = |fit: &CalibratedCamera| fit.camera.block("brown_conrady").map(|block| block.free.clone());
        let mut orders = Vec::new();
        for model in [&options.calibrate, &with_bow, &options.calibrate, &with_bow] {
            let (fit, expected) = (bench.fit(model).unwrap(), calibrate_camera(&capture, model).unwrap());
            assert_eq!(lens(&fit), lens(&expected));
            let [rms, expected_rms] = [&fit, &expected].map(|fit| fit.depth_rms_mm.unwrap());
            assert!((rms / expected_rms - 1.0).abs() < 0.01, "{rms} {expected_rms}");
            orders.push(lens(&fit));
        }
        assert_ne!(orders[0], orders[1], "the bend hides terms of the lens");
    }
}
