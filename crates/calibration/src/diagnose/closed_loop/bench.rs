//! Fits of models, and their errors on frames that a fit did not see: all that the steps of the loop ask of the rest of the
//! program, so that a linear problem can stand in for it.

use depthcal_model::{Covariate, PieceSpec, Register};
use depthcal_solver::score::ScoreError;

use super::augmented_model::AugmentedModel;
use crate::calibrate::{CalibrateError, CalibratedCamera, CameraOptions};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::discovery::{Chance, Component, OfCovariates, Search};
use crate::diagnose::examination::{EffectTest, Examination};
use crate::diagnose::held_out::{Gain, HeldOut, gain};
use crate::diagnose::options::CameraDiagnoseOptions;
use crate::diagnose::thresholds::Thresholds;

/// A fit and its errors on frames that it did not see.
#[derive(Clone)]
pub(super) struct Fitted {
    pub fit: CalibratedCamera,
    pub held_out: HeldOut,
}

impl Fitted {
    /// The gain of this model over the one `before` on held-out frames, with depth weighted by the noise of this one; `added` are
    /// the effects that it has more.
    pub fn gain_over(&self, before: &Self, added: &[AddedEffect], thresholds: &Thresholds) -> Gain {
        let is_of_time = |effect: &AddedEffect| {
            let needs = effect.evidence.block.piece().map(|piece| piece.needs()).unwrap_or_default();
            needs.iter().any(|c| matches!(c, Covariate::Time | Covariate::Temperature | Covariate::Quantity(_)))
        };
        let of_time = added.iter().any(is_of_time);
        gain(&before.held_out, &self.held_out, &self.fit.noise.depth, of_time, thresholds)
    }
}

/// Fits and judges models, on frames that it knows.
pub(super) trait Bench {
    /// Declared model, folds and thresholds.
    fn options(&self) -> &CameraDiagnoseOptions;

    /// Reports to the progress what is being done, and with which model.
    fn report(&self, what: &str, model: &CameraOptions);

    /// Fits a model to the frames.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] where it cannot be fitted.
    fn fit(&self, model: &CameraOptions) -> Result<CalibratedCamera, CalibrateError>;

    /// Held-out errors of a model: those of its fit on the dataset that verifies, or by cross-validation on the frames.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] where no fold can be fitted.
    fn held_out(&self, fit: &CalibratedCamera, model: &CameraOptions) -> Result<HeldOut, CalibrateError>;

    /// Fits a model, refines constants, places and forms of all added effects, and fits again. The model is returned as refined.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] where it cannot be fitted.
    fn refined(&self, model: AugmentedModel) -> Result<(AugmentedModel, Fitted), CalibrateError>;

    /// The evidence for every effect that a fit lacks.
    ///
    /// # Errors
    ///
    /// [`ScoreError`] where the problem cannot be evaluated.
    fn examine(&self, fit: &CalibratedCamera) -> Result<Examination, ScoreError>;

    /// Tests one effect that a fit lacks; `None` where the problem cannot be evaluated.
    fn test(&self, fit: &CalibratedCamera, register: &Register, effect: &PieceSpec) -> Option<EffectTest>;

    /// Searches a formula for what a fit leaves, with none of the names `taken`.
    fn discover(
        &self,
        fit: &CalibratedCamera,
        chance: Chance<'_>,
        examination: &Examination,
        taken: &[String],
    ) -> Search;

    /// A formula of some covariates, of which a function is known to explain what a fit leaves; `None` where there is none.
    fn formula_of(
        &self,
        covariates: &[String],
        fit: &CalibratedCamera,
        examination: &Examination,
        taken: &[String],
    ) -> Option<OfCovariates>;

    /// The functions that what a fit leaves depends on, each certain given all others, with none of the names `taken`.
    fn components(&self, fit: &CalibratedCamera, taken: &[String]) -> Vec<Component>;

    /// Options of the declared model.
    fn declared(&self) -> &CameraOptions {
        &self.options().calibrate
    }

    /// Thresholds of the rules.
    fn thresholds(&self) -> &Thresholds {
        &self.options().thresholds
    }

    /// Fit and held-out errors of a model.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] of either.
    fn fitted(&self, model: &CameraOptions) -> Result<Fitted, CalibrateError> {
        let fit = self.fit(model)?;
        Ok(Fitted { held_out: self.held_out(&fit, model)?, fit })
    }
}
