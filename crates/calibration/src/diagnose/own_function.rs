//! The free function of an effect's own covariate, in the effect's place and form: an effect of one covariate, or of the place in
//! the image, is named only where it explains nearly all that any function there does.

use std::iter::once;

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::{Block, Context, Of, On, PieceSpec, Register};
use depthcal_solver::additive::{Axis, CUBIC};
use depthcal_solver::score::ScoreError;

use super::along::Along;
use super::candidate_blocks::{CandidateBlock, linearize};
use super::candidates::missing_effects;
use super::discovery::Discovery;
use super::evidence::{Evidence, difference};
use super::free_functions::{FreeFunction, free_function};
use super::merit::significant;
use super::observed_states::ObservedStates;
use super::spline_piece::Action;
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;

/// Basis functions: two and a half for each cycle of the shortest wave that is searched. Their smoothness is chosen by gains on
/// left-out frames.
const BASIS_FUNCTIONS: usize = 64;
/// Basis functions of a function of the place in the image, along its columns and its rows.
const MAP: [usize; 2] = [12, 9];
/// Share by which D may scale inverse depth: the measured one has a range that is wider by it at both ends.
const DEPTH_MODEL_MARGIN: f64 = 0.08;
/// Observations at which it is tried what an effect depends on.
const TRIED: usize = 48;
/// Largest change of an effect, over its size, by what it does not depend on.
const UNCHANGED: f64 = 1e-6;

/// Covariates of which one alone may decide about an effect.
const COVARIATES: [Along; 6] =
    [Along::Depth, Along::Amplitude, Along::Incidence, Along::Time, Along::Temperature, Along::Pixel];

/// Form in which a block of the depth hook acts.
fn form(block: &Block) -> Option<On> {
    let piece = block.piece().filter(|piece| piece.can_be_placed())?;
    Some(piece.placement().on.unwrap_or(piece.form()))
}

/// The covariate on which alone the shape of an effect of depth depends, in its form; `None` for effects of several covariates.
pub(super) fn own_covariate(block: &Block, states: &ObservedStates) -> Option<Along> {
    let (piece, on) = (block.piece()?, form(block)?);
    let theta: Vec<f64> = block.parameters().iter().map(|p| p.nominal + p.scale).collect();
    let shape = |(state, context): ([f64; 4], Context)| {
        let mut out = [0.0];
        piece.evaluate(&theta, &state, &[context], &mut out);
        on.size_mm(state[2], out[0])
    };
    let observed: Vec<([f64; 4], Context)> = states.spread(TRIED).collect();
    let sizes: Vec<f64> = observed.iter().copied().map(shape).collect();
    let largest = sizes.iter().fold(0.0_f64, |most, size| most.max(size.abs()));
    let depends_on_it_alone = |along: &Along| {
        // Everything but the covariate from another observation.
        let others = observed.iter().cycle().skip(TRIED / 2 + 1);
        let mixed = observed.iter().zip(others).map(|(own, other)| {
            let (mut state, mut context) = *other;
            match along {
                Along::Depth => state[2] = own.0[2],
                Along::Incidence => state[3] = own.0[3],
                Along::Amplitude => context.amplitude = own.1.amplitude,
                Along::Time => context.time_s = own.1.time_s,
                Along::Temperature => context.temperature_c = own.1.temperature_c,
                Along::Quantity(_) => context.quantities = own.1.quantities,
                _ => {
                    state[..2].copy_from_slice(&own.0[..2]);
                    context.pixel = own.1.pixel;
                }
            }
            (state, context)
        });
        mixed.zip(&sizes).all(|(mixed, size)| (shape(mixed) - size).abs() <= UNCHANGED * largest)
    };
    let quantities = states.quantities().into_iter().map(Along::Quantity);
    COVARIATES.into_iter().chain(quantities).find(depends_on_it_alone).filter(|_| largest > 0.0)
}

/// Whether an effect and a found function depend on one covariate alone, the same.
pub(super) fn is_of_its_covariate(block: &Block, states: &ObservedStates, function: &Discovery) -> bool {
    let covariate = || Some((own_covariate(block, states)?, function.effect.covariates()));
    match covariate() {
        Some((Along::Depth, [C::Z]))
        | Some((Along::Amplitude, [C::Amplitude]))
        | Some((Along::Incidence, [C::Incidence]))
        | Some((Along::Time, [C::Time]))
        | Some((Along::Temperature, [C::Temperature])) => true,
        Some((Along::Quantity(of_effect), [C::Quantity(quantity)])) => of_effect == *quantity,
        _ => false,
    }
}

/// The free function that an effect is compared with, over an image of `size` columns and rows; `None` for effects of several
/// covariates.
fn own_function(block: &Block, states: &ObservedStates, size: [usize; 2]) -> Option<FreeFunction> {
    let (along, on, placement) = (own_covariate(block, states)?, form(block)?, block.placement());
    let axes = if along == Along::Pixel {
        [0, 1].map(|i| Axis { low: 0.0, high: size[i] as f64 - 1.0, count: MAP[i], degree: CUBIC }).to_vec()
    } else {
        let range = states.range(|state, context| along.coordinates(state, context)[0]).filter(|r| r.span() > 0.0)?;
        let margin = if along == Along::Depth && placement.of == Of::Measured { DEPTH_MODEL_MARGIN } else { 0.0 };
        let (low, high) = (range.low * (1.0 - margin), range.high * (1.0 + margin));
        vec![Axis { low, high, count: BASIS_FUNCTIONS, degree: CUBIC }]
    };
    Some(free_function("its own covariate", along, Action::Depth(placement.of, on), axes))
}

/// Share that an effect explains, given the `others` that are added with it, of what it and the free function of its own
/// covariate explain together on left-out frames, and that covariate; `None` for effects of several covariates, and where the
/// function adds nothing that is significant.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub(super) fn share_of_own_function(
    fit: &CalibratedCamera,
    register: &Register,
    states: &ObservedStates,
    effect: &Evidence,
    others: &[&Evidence],
    thresholds: &Thresholds,
) -> Result<Option<(Along, f64)>, ScoreError> {
    let Some(FreeFunction { along, block, smoothness, name }) =
        own_function(&effect.block, states, [fit.camera.width, fit.camera.height])
    else {
        return Ok(None);
    };
    let of_effect = |spec: &PieceSpec| CandidateBlock::effect(register, spec.clone());
    let variants = variants(fit, register, states, effect);
    let mut candidates: Vec<CandidateBlock> =
        others.iter().map(|e| &e.spec).chain(&variants).filter_map(of_effect).collect();
    let spec = PieceSpec::new(name);
    let (name, smoothness) = (name.to_owned(), Some(smoothness));
    candidates.push(CandidateBlock { name, spec, value: None, along: Some(along), block, smoothness });
    let linearization = linearize(fit, &candidates)?;
    let (first, function) = (others.len(), candidates.len() - 1);
    let others: Vec<usize> = (0..first).collect();
    let with = |more: &[usize]| linearization.held_out_gain(&[&others, more].concat());
    let total = |gains: &[f64]| gains.iter().sum::<f64>();
    let of_variants = (first..function).map(|variant| (variant, with(&[variant])));
    let Some((variant, of_effects)) = of_variants.max_by(|a, b| total(&a.1).total_cmp(&total(&b.1))) else {
        return Ok(None);
    };
    let explained = total(&difference(&of_effects, &with(&[])));
    let added = difference(&with(&[variant, function]), &of_effects);
    let p_value = linearization.score_adjusted(function, &[&others[..], &[variant]].concat()).p_value;
    let left = if significant(p_value, 1, &added, thresholds) { total(&added) } else { 0.0 };
    Ok((left > 0.0).then(|| (along, explained / (explained + left))))
}

/// The spec of an effect, and with those values of its constant that are searched only once it is in the model.
fn variants(fit: &CalibratedCamera, register: &Register, states: &ObservedStates, effect: &Evidence) -> Vec<PieceSpec> {
    let missing = missing_effects(register, fit, states);
    let later = missing.iter().filter(|missing| missing.name == effect.name).flat_map(|missing| {
        let placement = effect.spec.placement;
        missing.afterwards.iter().map(move |value| missing.spec(Some(*value), placement))
    });
    once(effect.spec.clone()).chain(later.filter(|spec| *spec != effect.spec)).collect()
}

#[cfg(test)]
mod tests {
    use depthcal_model::Placement;
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CameraOptions, calibrate_camera};
    use crate::simulated;

    #[test]
    fn effects_of_one_covariate_are_known_in_every_place_and_form() {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 3);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let fit = calibrate_camera(&capture, &CameraOptions::default()).unwrap();
        let states = ObservedStates::of(&fit);
        let register = Register::builtin();
        let covariate = |name: &str, placement: Placement| {
            own_covariate(&register.make(&PieceSpec::new(name).placed(placement), None).unwrap(), &states)
        };
        for of in Of::ALL {
            for on in On::ALL {
                let placement = Placement { of, on: Some(on) };
                assert_eq!(covariate("cyclic_depth", placement), Some(Along::Depth), "{placement}");
                assert_eq!(covariate("disparity_ripple", placement), Some(Along::Depth), "{placement}");
                assert_eq!(covariate("quadratic_depth", placement), Some(Along::Depth), "{placement}");
                assert_eq!(covariate("incidence_bias", placement), Some(Along::Incidence), "{placement}");
                assert_eq!(covariate("reflectivity_bias", placement), Some(Along::Amplitude), "{placement}");
                for of_place in ["projector_distortion", "radial_range", "range_offset"] {
                    assert_eq!(covariate(of_place, placement), Some(Along::Pixel), "{of_place}{placement}");
                }
                assert_eq!(covariate("temporal_drift", placement), None, "{placement}");
            }
        }
        assert_eq!(covariate("board_bow", Placement::default()), None);
    }
}
