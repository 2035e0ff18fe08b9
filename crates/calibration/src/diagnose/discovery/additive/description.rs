//! Formulas that describe functions without a name: splines of their covariates, as fine and as smooth as predicts left-out
//! frames best.

use std::collections::BTreeSet;

use depthcal_formula::FormulaCovariate as C;
use depthcal_io::DiagnosisPlace;
use depthcal_solver::additive::{Found, Strengths};
use tracing::debug;

use super::super::discovered::Discovery;
use super::super::observations::Observations;
use super::dictionary::{Dictionary, Function};
use super::spline_formula::{Part, formula};

/// Multiples of the usual number of basis functions that are compared.
const FINER: [usize; 2] = [1, FINEST];
/// The largest of them.
pub(super) const FINEST: usize = 2;
/// Fall of the cost ½ Σ r² of left-out frames per sample that a finer spline has to bring: a hundredth of what noise leaves.
const LEAST_GAIN_PER_SAMPLE: f64 = 0.005;

/// The formulas that describe functions that were found, those of the dictionary, or why there is none. `taken` are names of
/// pieces.
pub(super) fn descriptions(
    observations: &Observations,
    dictionary: &Dictionary,
    found: &[Found],
    taken: &[String],
) -> Vec<Result<Discovery, String>> {
    let worth = LEAST_GAIN_PER_SAMPLE * observations.samples().count() as f64;
    let dictionaries = FINER.map(|finer| dictionary.finer(finer));
    let models = dictionaries.each_ref().map(|dictionary| dictionary.model(observations));
    let mut best: Option<(usize, Strengths<'_>)> = None;
    for (number, model) in models.iter().enumerate() {
        let Some(strengths) = Strengths::best(model, found) else { continue };
        debug!("additive: {} times as fine: gain {:.1}", FINER[number], strengths.gain());
        if best.as_ref().is_none_or(|(_, coarser)| strengths.gain() > coarser.gain() + worth) {
            best = Some((number, strengths));
        }
    }
    let Some((number, strengths)) = best else { return Vec::new() };
    let dictionary = &dictionaries[number];
    let functions = &dictionary.functions;
    let mut taken = taken.to_vec();
    let description = |(place, function): (usize, &Found)| {
        let precisions = strengths.precisions(place);
        let part = |(number, precision): (&usize, _)| Part {
            function: &functions[*number],
            precision,
            rms: rms(observations, &functions[*number]),
        };
        let parts: Vec<Part<'_>> = function.groups.iter().zip(precisions).map(part).collect();
        let description = described(&dictionary.covariates_of(&function.covariates), &parts, &taken, functions.len())?;
        taken.push(description.effect.name().to_owned());
        Ok(description)
    };
    found.iter().enumerate().map(description).collect()
}

/// `terms` is the number of functions of the dictionary.
fn described(
    covariates: &BTreeSet<C>,
    parts: &[Part<'_>],
    taken: &[String],
    terms: usize,
) -> Result<Discovery, String> {
    let Function { of, on, .. } = parts[0].function;
    Ok(Discovery {
        covariates: covariates.iter().map(|c| c.name().to_owned()).collect(),
        covariates_not_told_apart: Vec::new(),
        place: DiagnosisPlace { of: *of, on: *on },
        places_not_told_apart: Vec::new(),
        p_value: 0.0,
        stability: 1.0,
        confirmed: false,
        replication: None,
        share_of_free_function: 1.0,
        resembles: Vec::new(),
        runners_up: Vec::new(),
        terms,
        replaced: Vec::new(),
        components: Vec::new(),
        effect: formula(covariates, parts, taken)?,
    })
}

/// Root mean square over the samples of the change of inverse depth where the splines of a function are 1.
fn rms(observations: &Observations, function: &Function) -> f64 {
    let samples = observations.samples();
    let squares = samples.clone().map(|sample| function.weight_in_inverse_depth(sample).powi(2));
    (squares.sum::<f64>() / samples.count().max(1) as f64).sqrt()
}
