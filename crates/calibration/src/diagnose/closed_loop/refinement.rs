//! Constants, places, forms and modulation frequencies of added effects, searched jointly with everything else that the model
//! has.

use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use crate::calibrate::{CalibrateError, CalibratedCamera};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::modulation_search::promising_modulations;
use crate::diagnose::variant_search::{Refined, refined_variant};
use crate::judge::cross_validation::weighted_gain_percent;

/// Fits a model, refines constants, places and forms of all added effects, the last one first, and fits again where any changed.
/// Where the data do not determine all parameters of the last effect, those that they determine worst are held.
///
/// # Errors
///
/// [`CalibrateError`] where the model cannot be fitted.
pub(super) fn refined(
    bench: &impl Bench,
    mut model: AugmentedModel,
) -> Result<(AugmentedModel, Fitted), CalibrateError> {
    let declared = bench.declared();
    let reduced = model.added.last().and_then(|last| last.evidence.reduced.clone());
    let mut fit = match (bench.fit(&model.options(declared)), reduced) {
        (Err(CalibrateError::Undetermined(_)), Some(reduced)) => {
            model.set_last_spec(reduced);
            bench.fit(&model.options(declared))?
        }
        (other, _) => other?,
    };
    (model, fit) = with_modulation(bench, model, fit)?;
    for i in (0..model.added.len()).rev() {
        let evidence = &model.added[i].evidence;
        let variant = refined_variant(&fit, &declared.register, evidence, bench.thresholds());
        let Some(Refined { evidence: variant, rivals }) = variant else { continue };
        let is_new = variant.spec != evidence.spec;
        model.added[i] = AddedEffect { evidence: variant, placements_not_told_apart: rivals, ..model.added[i].clone() };
        if is_new {
            fit = bench.fit(&model.options(declared))?;
        }
    }
    let held_out = bench.held_out(&fit, &model.options(declared))?;
    Ok((model, Fitted { fit, held_out }))
}

/// The model with other modulation frequencies of the effect that was added last, fitted anew, where it depends on them and
/// others explain more; else model and fit as they are. Frequencies are compared by score tests first, and where one of them
/// explains more than the present ones, the best by fits and held-out errors: the effect is not linear in the share of the light
/// where pixels are dark.
fn with_modulation(
    bench: &impl Bench,
    mut model: AugmentedModel,
    fit: CalibratedCamera,
) -> Result<(AugmentedModel, CalibratedCamera), CalibrateError> {
    let declared = bench.declared();
    let Some(added) = model.added.last() else { return Ok((model, fit)) };
    let specs = promising_modulations(&fit, &declared.register, &added.evidence, bench.thresholds());
    let specs = specs.unwrap_or_else(|error| {
        info!("modulation frequencies are not searched: {error}");
        Vec::new()
    });
    if specs.is_empty() {
        return Ok((model, fit));
    }
    let noise = fit.noise.depth;
    let present = bench.held_out(&fit, &model.options(declared))?;
    let (mut best, mut most) = (added.evidence.spec.clone(), 0.0);
    for spec in specs {
        model.set_last_spec(spec.clone());
        let held_out = match bench.fitted(&model.options(declared)) {
            Ok(fitted) => fitted.held_out,
            Err(error) => {
                info!("{spec}: {error}");
                continue;
            }
        };
        let gain = weighted_gain_percent(&present.evaluated, &held_out.evaluated, &noise);
        if let Some(gain) = gain.filter(|gain| gain.is_certain() && gain.value > most) {
            (best, most) = (spec, gain.value);
        }
    }
    model.set_last_spec(best);
    let fit = bench.fit(&model.options(declared))?;
    Ok((model, fit))
}
