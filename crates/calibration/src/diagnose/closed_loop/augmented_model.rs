//! The declared model with the effects that the loop has added.

use depthcal_model::{PieceSpec, Register};
use tracing::info;

use crate::adjust::blocks::is_depth_only;
use crate::calibrate::{CalibratedCamera, CameraOptions};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::discovery::Discovery;
use crate::diagnose::merit::merit;

/// The effects and formulas by which the declared model is augmented. A value: a step makes another one, which the state of the
/// loop takes over or not.
#[derive(Clone, Default)]
pub(super) struct AugmentedModel {
    /// The added effects, in order.
    pub added: Vec<AddedEffect>,
    /// The definitions of those that are formulas, and of one that is about to be added.
    pub formulas: Vec<Discovery>,
}

impl AugmentedModel {
    /// The declared register with the formulas that were found.
    pub fn register(&self, declared: &CameraOptions) -> Register {
        let mut register = declared.register.clone();
        for formula in &self.formulas {
            // Their names are free: the search chose them so.
            if let Err(error) = formula.effect.register(&mut register) {
                info!("{error}");
            }
        }
        register
    }

    /// Options of a fit: those of the declared model, with the added effects.
    pub fn options(&self, declared: &CameraOptions) -> CameraOptions {
        let mut options = CameraOptions { register: self.register(declared), ..declared.clone() };
        options.effects.extend(self.added.iter().map(|effect| effect.evidence.spec.clone()));
        options
    }

    /// Names that no further piece may have: those of its fit, and of its formulas.
    pub fn names(&self, fit: &CalibratedCamera) -> Vec<String> {
        let formulas = self.formulas.iter().map(|formula| formula.effect.name().to_owned());
        fit.camera.blocks().iter().map(|block| block.name().to_owned()).chain(formulas).collect()
    }

    /// The model with an effect more.
    pub fn with(mut self, effect: AddedEffect) -> Self {
        self.added.push(effect);
        self
    }

    /// The model without the added effect number `place`.
    pub fn without(&self, place: usize) -> Self {
        let mut without = self.clone();
        without.added.remove(place);
        without.with_own_formulas()
    }

    /// The model without definitions of formulas that are not among its effects: their names are free again.
    pub fn with_own_formulas(mut self) -> Self {
        let Self { added, formulas } = &mut self;
        formulas.retain(|formula| added.iter().any(|effect| effect.evidence.name == formula.effect.name()));
        self
    }

    /// The model with the first `count` of the added effects.
    pub fn first(&self, count: usize) -> Self {
        Self { added: self.added[..count].to_vec(), formulas: self.formulas.clone() }.with_own_formulas()
    }

    /// The model without the added effects of depth that images do not show.
    pub fn without_depth_effects(&self) -> Self {
        let added = self.added.iter().filter(|effect| !is_depth_only(&effect.evidence.block)).cloned().collect();
        Self { added, formulas: self.formulas.clone() }.with_own_formulas()
    }

    /// Gives the effect that was added last another specification.
    pub fn set_last_spec(&mut self, spec: PieceSpec) {
        if let Some(last) = self.added.last_mut() {
            last.evidence.spec = spec;
        }
    }

    /// Specifications of the added effects from number `first` on.
    pub fn specs_from(&self, first: usize) -> Vec<PieceSpec> {
        self.added[first..].iter().map(|effect| effect.evidence.spec.clone()).collect()
    }

    /// Merit of the effect that was added last, as a share of the cost before it.
    pub fn share_of_last(&self, cost: f64) -> f64 {
        self.added.last().map_or(0.0, |effect| merit(&effect.evidence) / cost)
    }
}
