//! The last model has effects only whose gain, given all others, is certain.

use depthcal_io::GainInterval;
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::revisit::{is_plain_by_wald, with_errors_along};
use super::state::{Event, Judged, State};
use crate::calibrate::CalibrateError;
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::free_map::FREE_MAP;
use crate::diagnose::held_out::Gain;
use crate::diagnose::possible::Possible;

/// Removes the effects of the last model whose gain, given all others, is not certain: they are possible. The least one goes
/// first, as another may be certain without it. The others have their gains from then on. A free map names nothing: it stays,
/// and takes no part. `None` where there is no effect.
///
/// # Errors
///
/// [`CalibrateError`] where models along the way cannot be fitted again.
pub(super) fn without_uncertain(bench: &impl Bench, state: &State) -> Result<Option<Event>, CalibrateError> {
    let State { model, present, first, .. } = state;
    let (mut model, mut present, mut possible) = (model.clone(), present.clone(), Vec::new());
    let map = model.added.pop_if(|last| last.evidence.name == FREE_MAP);
    if model.added.is_empty() {
        return Ok(None);
    }
    if map.is_some() {
        present = bench.fitted(&model.options(bench.declared()))?;
    }
    let mut first_changed = usize::MAX;
    let is_plain = |effect: &&AddedEffect| is_plain_by_wald(&present.fit, effect, bench.thresholds());
    // First those that may be uncertain, then those that were, as long as there are any; in the end all of the last model.
    let mut asked = names_of(model.added.iter().filter(|effect| !is_plain(effect)));
    let mut certain: Vec<String> = Vec::new();
    loop {
        let Uncertain { least, names } = uncertain(bench, (&mut model, &asked), &present, first);
        match least {
            Some(Least { place, gain_percent, without }) => {
                let effect = model.added.remove(place);
                let frames = present.held_out.evaluated.frames.len();
                possible.extend(gain_percent.map(|gain| Possible::new(effect.evidence.spec, gain, frames)));
                first_changed = first_changed.min(place);
                present = without;
                // Of another model.
                certain.clear();
                asked = names;
            }
            None => {
                certain.append(&mut asked);
                asked = names_of(model.added.iter().filter(|effect| !certain.contains(&effect.evidence.name)));
                if asked.is_empty() {
                    break;
                }
            }
        }
    }
    model = with_errors_along(bench, model.with_own_formulas(), first_changed, &present.held_out)?;
    if let Some(map) = map {
        model = model.with(map);
        present = match first_changed {
            usize::MAX => state.present.clone(),
            _ => bench.fitted(&model.options(bench.declared()))?,
        };
        if let Some(map) = model.added.last_mut() {
            map.after = present.held_out.clone();
        }
    }
    Ok(Some(Event::Judged(Box::new(Judged { model, present, possible }))))
}

fn names_of<'a>(effects: impl Iterator<Item = &'a AddedEffect>) -> Vec<String> {
    effects.map(|effect| effect.evidence.name.clone()).collect()
}

/// An effect whose gain is not certain.
struct Least {
    place: usize,
    /// Its gain; `None` where there is none.
    gain_percent: Option<GainInterval>,
    without: Fitted,
}

/// The effects of a model whose gain is not certain.
#[derive(Default)]
struct Uncertain {
    /// The one with the least gain.
    least: Option<Least>,
    names: Vec<String>,
}

/// The effects of a model whose gain, given all others, is not certain, of those that are asked for by name; gives the others
/// their gains. `first` is the declared model.
fn uncertain(
    bench: &impl Bench,
    (model, asked): (&mut AugmentedModel, &[String]),
    present: &Fitted,
    first: &Fitted,
) -> Uncertain {
    let mut uncertain = Uncertain::default();
    for place in 0..model.added.len() {
        let name = model.added[place].evidence.name.clone();
        if !asked.contains(&name) {
            continue;
        }
        let rest_of_model = model.without(place);
        let without = match rest_of_model.added.is_empty() {
            true => Ok(first.clone()),
            false => bench.fitted(&rest_of_model.options(bench.declared())),
        };
        let without = match without {
            Ok(without) => without,
            Err(error) => {
                info!("without {name}: {error}");
                continue;
            }
        };
        let gain_percent = match present.gain_over(&without, &model.added[place..=place], bench.thresholds()) {
            Gain::Certain(gain) => {
                model.added[place].gain_percent = Some(gain);
                continue;
            }
            Gain::Possible(gain) => Some(gain),
            Gain::None => None,
        };
        uncertain.names.push(name);
        let value = |gain: Option<GainInterval>| gain.map_or(0.0, |gain| gain.value);
        if uncertain.least.as_ref().is_none_or(|least| value(gain_percent) < value(least.gain_percent)) {
            uncertain.least = Some(Least { place, gain_percent, without });
        }
    }
    uncertain
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{LinearBench, regressor, sum};
    use super::*;

    fn names(state: &State) -> Vec<&str> {
        state.model.added.iter().map(|effect| effect.evidence.name.as_str()).collect()
    }

    /// Without the second effect, which is not there, the first, which resembles it, is certain.
    #[test]
    fn uncertain_effects_of_the_last_model_are_possible() {
        let (a, other) = (regressor(1), regressor(2));
        let resembling = sum(&[(1.0, &a), (0.3, &other)]);
        let bench = LinearBench::new(&[("range_offset", 0.5, a), ("radial_range", 0.0, resembling)]);
        let mut state = bench.state(&["range_offset", "radial_range"]);
        let event = without_uncertain(&bench, &state).unwrap().unwrap();
        state.apply(event);
        assert_eq!(names(&state), ["range_offset"]);
        let gain = |state: &State| state.model.added[0].gain_percent;
        assert!(gain(&state).is_some_and(|gain| gain.is_certain()));
        let again = without_uncertain(&bench, &state).unwrap().unwrap();
        let before = gain(&state);
        state.apply(again);
        assert_eq!((names(&state), gain(&state)), (vec!["range_offset"], before));
    }
}
