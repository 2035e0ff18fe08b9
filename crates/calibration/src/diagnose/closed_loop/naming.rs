//! A function that the residuals depend on, explained by an effect of the catalogue or by a formula, given all others.

use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::decided::{Decided, decided};
use super::formula::with_formula;
use super::functions::{Model, with_functions};
use super::lost_gain::{Says, has_covariates_of, says};
use super::proposal::Proposal;
use super::state::Memory;
use crate::adjust::blocks::is_depth_only;
use crate::calibrate::CalibratedCamera;
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::decision::Decision;
use crate::diagnose::discovery::Discovery;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::examination::Examination;
use crate::diagnose::held_out::Gain;
use crate::diagnose::own_function::is_of_its_covariate;

/// Effects of the catalogue that are tried for a function.
const MOST_NAMES: usize = 2;

/// A function, and what it explains.
struct Function<'a> {
    /// Its definition, where it is a formula.
    definition: Option<&'a Discovery>,
    /// The fit with it, and the one without.
    with: &'a Fitted,
    without: &'a Fitted,
    /// Its number among the effects.
    place: usize,
}

/// Outcome of naming a function.
pub(super) enum Naming {
    /// An effect or a formula that explains as much takes its place.
    Named(Box<Model>),
    /// An effect with which the held-out errors are lower for certain than with the function that it was tried instead of. So it
    /// describes something else: the model lacks it.
    Missing(Box<AddedEffect>),
    /// Frames that the search has not seen do not have it.
    Refuted,
    /// Nothing explains as much.
    Nothing,
}

/// The model with an effect or a formula in the place of the function number `place`, given all others. Effects that were tried
/// in vain are in `memory`.
///
/// # Errors
///
/// [`DiagnoseError`] where the model without the function cannot be examined.
pub(super) fn named(bench: &impl Bench, memory: &Memory, with: &Model, place: usize) -> Result<Naming, DiagnoseError> {
    let (model, fitted) = with;
    let without = model.without(place);
    let reduced = match bench.fitted(&without.options(bench.declared())) {
        Ok(reduced) => reduced,
        Err(error) => {
            info!("additive: without {}: {error}", model.added[place].evidence.spec);
            return Ok(Naming::Nothing);
        }
    };
    // What is missing is no noise.
    let reduced = Fitted { fit: CalibratedCamera { noise: fitted.fit.noise, ..reduced.fit }, ..reduced };
    let report = || bench.report("explaining a function of what is left", &without.options(bench.declared()));
    report();
    let examination = bench.examine(&reduced.fit)?;
    let definition = model.formulas.iter().find(|f| f.effect.name() == model.added[place].evidence.name);
    let function = Function { definition, with: fitted, without: &reduced, place };
    if let Some(naming) = by_effect(bench, memory, &function, &without, &examination)? {
        return Ok(naming);
    }
    let Some(definition) = definition else { return Ok(Naming::Nothing) };
    let taken = without.names(&reduced.fit);
    report();
    let Some(formula) = bench.formula_of(&definition.covariates, &reduced.fit, &examination, &taken) else {
        return Ok(Naming::Nothing);
    };
    let name = formula.discovery.effect.text();
    if formula.discovery.is_refuted() {
        info!("additive: frames that the search has not seen do not have {name}");
        return Ok(Naming::Refuted);
    }
    let with = with_formula(bench, &without, &reduced, formula.discovery.clone());
    let with = with.filter(|(_, named)| says(&reduced, fitted, named, (&name, true)) == Says::AsMuch);
    let Some((mut model, named)) = with else { return Ok(Naming::Nothing) };
    if let Some(discovery) = model.formulas.last_mut() {
        formula.tell_rivals(discovery, &reduced.fit, bench.thresholds());
    }
    Ok(Naming::Named(Box::new((in_place(model, place), named))))
}

/// The function explained by an effect of the catalogue; the model is that without the function.
fn by_effect(
    bench: &impl Bench,
    memory: &Memory,
    function: &Function<'_>,
    without: &AugmentedModel,
    examination: &Examination,
) -> Result<Option<Naming>, DiagnoseError> {
    let mut memory = memory.clone();
    for _ in 0..MOST_NAMES {
        let Decided { decision, .. } = decided(&function.without.fit, examination, &memory, bench.options())?;
        let Decision::Add { effect, indistinguishable, .. } = &decision else { break };
        let proposal = Proposal { effect: *effect, jointly_with: &[], indistinguishable };
        let effect = proposal.effects(examination, &function.without.held_out).swap_remove(0);
        let (name, block) = (effect.evidence.spec.to_string(), &effect.evidence.block);
        memory.tried.rejected.push(effect.evidence.name.clone());
        // A function of depth is explained by an effect of depth.
        if !is_depth_only(block) {
            continue;
        }
        let (is_alone, is_own) = function.definition.map_or((false, false), |f| {
            let has_its_covariates = has_covariates_of(block, f);
            let is_alone = is_of_its_covariate(block, &examination.states, f)
                || has_its_covariates && f.effect.covariates().len() == 1;
            (is_alone, is_alone || has_its_covariates)
        });
        let (mut model, named) = match bench.refined(without.clone().with(effect)) {
            Ok(with) => with,
            Err(error) => {
                info!("additive: {name}: {error}");
                continue;
            }
        };
        match says(function.without, function.with, &named, (&name, is_own)) {
            Says::AsMuch => return Ok(Some(Naming::Named(Box::new((in_place(model, function.place), named))))),
            Says::MuchMore => {
                let last = model.added.split_off(model.added.len() - 1);
                if matches!(named.gain_over(function.with, &last, bench.thresholds()), Gain::Certain(_))
                    && let Some(effect) = last.into_iter().next()
                {
                    return Ok(Some(Naming::Missing(Box::new(effect))));
                }
            }
            Says::Most if is_alone => {
                let with = with_remainder(bench, function, (in_place(model, function.place), named));
                return Ok(Some(Naming::Named(Box::new(with))));
            }
            Says::Most | Says::Less => {}
        }
    }
    Ok(None)
}

/// The model with an effect that explains most of a function of its own covariate, and with the function for the remainder where
/// the held-out errors are lower for certain with it.
fn with_remainder(bench: &impl Bench, function: &Function<'_>, with: Model) -> Model {
    let (model, named) = &with;
    let Some((both, fitted)) = with_functions(bench, model, named, function.definition.cloned()) else { return with };
    let gain = fitted.gain_over(named, &both.added[model.added.len()..], bench.thresholds());
    info!("additive: the remainder of a function beside its name: {gain:?}");
    if matches!(gain, Gain::Certain(_)) { (both, fitted) } else { with }
}

/// The model with its last effect at number `place`.
fn in_place(mut model: AugmentedModel, place: usize) -> AugmentedModel {
    if let Some(last) = model.added.pop() {
        model.added.insert(place, last);
    }
    model
}
