//! Additive model of the residuals, several functions at once: smooth functions of one covariate, each alone or times another, in
//! every place and form.
//!
//! The search is that of [`depthcal_solver::additive`]; here are the functions of a depth camera (`dictionary`). A function that
//! no known effect explains is described by a formula (`description`).

mod description;
mod dictionary;
mod spline_formula;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use depthcal_io::DiagnosisSearched;
use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Camera, Register};
use depthcal_solver::additive::{Found, certain, grown, widened};
use tracing::info;

use self::description::{FINEST, descriptions};
use self::dictionary::Dictionary;
use super::discovered::Discovery;
use super::observations::Observations;
use crate::calibrate::CalibratedCamera;
use crate::diagnose::candidate_blocks::with_pieces;

/// Depth samples that take part, about: the products of all columns take most of the time.
const MOST_SAMPLES: usize = 6000;
/// … where only the covariates are looked at.
const SAMPLES_OF_SPANS: usize = 600;

/// A function that the residuals depend on, given all others, as a formula that describes it.
#[derive(Debug, Clone)]
pub struct Component {
    /// Share of the squared residuals of left-out frames that it explains given all others.
    pub share: f64,
    /// A smooth formula.
    pub description: Discovery,
}

/// Most parameters of an effect of the board that is left open while functions are searched.
const MOST_OF_BOARD: usize = 3;

/// Names of the effects of `register` on the board that a camera lacks: a bent or a stretched board hides what depth depends
/// on, and poses follow it.
pub fn effects_of_board<'a>(register: &'a Register, camera: &'a Camera) -> impl Iterator<Item = &'static str> + 'a {
    register.names().filter(|name| {
        let is_simple = |block: &Block| block.hook() == HookKind::Board && block.theta.len() <= MOST_OF_BOARD;
        camera.block(name).is_none() && register.block(name, None).is_ok_and(|block| is_simple(&block))
    })
}

/// A fit whose camera also has the board's effects of `register` and those named in `open`, all with free parameters that
/// start at their nominal values.
fn with_open(fit: &CalibratedCamera, register: &Register, open: &[&'static str]) -> CalibratedCamera {
    let names = effects_of_board(register, &fit.camera).chain(open.iter().copied());
    let blocks = names.filter_map(|name| register.block(name, None).ok());
    CalibratedCamera { camera: with_pieces(&fit.camera, blocks).0, ..fit.clone() }
}

/// The functions that the residuals of a fit depend on, none of them chance given all others, the shape of the board and the
/// effects `open`; `register` has these and the board's effects, and `taken` are names of pieces. Empty where nothing is found,
/// or where the frames cannot be evaluated.
pub fn additive_components(
    fit: &CalibratedCamera,
    register: &Register,
    open: &[&'static str],
    taken: &[String],
) -> Vec<Component> {
    let fit = with_open(fit, register, open);
    Observations::thinned(&fit, MOST_SAMPLES).map_or_else(Vec::new, |observations| described(&observations, taken))
}

/// The functions that are searched in the residuals of a fit; `None` where the frames cannot be evaluated.
pub fn searched(fit: &CalibratedCamera) -> Option<DiagnosisSearched> {
    Observations::thinned(fit, SAMPLES_OF_SPANS).map(|observations| Dictionary::of(&observations).searched())
}

/// The functions that residuals depend on, with their dictionary: those of the sets that explain most, compared with others
/// that say as much.
fn functions_of(observations: &Observations) -> (Dictionary, Vec<Found>) {
    let dictionary = Dictionary::of(observations);
    let mut sets = grown(&dictionary.model(observations));
    if sets.is_empty() {
        // A fine function may be seen where no other is.
        sets.push(Vec::new());
    }
    let known: Vec<usize> = sets.concat().into_iter().collect::<BTreeSet<usize>>().into_iter().collect();
    let wide = dictionary.with_fine_pairs(&known);
    let place_of = |function: &usize| known.iter().position(|other| other == function);
    let sets: Vec<Vec<usize>> = sets.iter().map(|set| set.iter().filter_map(place_of).collect()).collect();
    let candidates: Vec<usize> = (known.len()..wide.functions.len()).collect();
    // Where the fine functions are chance after all, what they took the place of counts.
    let with_fine = widened(&wide.model(observations), &sets, &candidates);
    let mut versions: Vec<Vec<usize>> = sets.into_iter().zip(with_fine).flat_map(<[_; 2]>::from).collect();
    // Searches from different starts end at the same functions.
    let mut seen = BTreeSet::new();
    versions.retain(|members| seen.insert(members.iter().copied().collect::<BTreeSet<usize>>()));
    let compared = versions.into_iter().map(|members| {
        let alternatives = wide.with_alternatives(&members);
        let places: Vec<usize> = (0..members.len()).collect();
        let (functions, gain) = certain(&alternatives.model(observations), &places);
        (alternatives, functions, gain)
    });
    let best = compared.max_by(|a, b| a.2.total_cmp(&b.2));
    match best {
        Some((alternatives, functions, _)) => {
            let functions = alternatives.finer(FINEST).within_formulas(functions);
            (alternatives, functions)
        }
        None => (dictionary, Vec::new()),
    }
}

/// The functions that residuals depend on, described by formulas.
fn described(observations: &Observations, taken: &[String]) -> Vec<Component> {
    let (dictionary, functions) = functions_of(observations);
    if functions.is_empty() {
        return Vec::new();
    }
    let mut components = Vec::new();
    for (Found { covariates, share, .. }, description) in
        functions.iter().zip(descriptions(observations, &dictionary, &functions, taken))
    {
        let names: Vec<&str> = dictionary.covariates_of(covariates).iter().map(|c| c.name()).collect();
        match description {
            Ok(description) => {
                info!("additive: {}, {share:.3} of the residuals: {}", names.join(", "), description.effect.text());
                components.push(Component { share: *share, description });
            }
            Err(reason) => info!("additive: {}: {reason}", names.join(", ")),
        }
    }
    components
}
