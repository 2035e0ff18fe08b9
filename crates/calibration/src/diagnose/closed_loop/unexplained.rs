//! Structure that no named effect explains: reported, and corrected by a free map where this lowers the errors.

use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::state::{Event, State};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::examination::Examination;
use crate::diagnose::free_functions::Along;
use crate::diagnose::free_map::{FREE_MAP, forms};
use crate::diagnose::held_out::Gain;
use crate::diagnose::left_over::LeftOver;
use crate::diagnose::merit::merit;
use crate::diagnose::round::RoundOutcome;
use crate::diagnose::thresholds::Thresholds;

/// Why the free function number `free` is not reported: it is too small to matter. `None` where it does.
pub(super) fn negligible(examination: &Examination, free: usize, thresholds: &Thresholds) -> Option<RoundOutcome> {
    let (merit, cost) = (merit(&examination.evidence[free]), examination.cost());
    let least_share = thresholds.least_unexplained_share;
    (merit < least_share * cost).then(|| RoundOutcome::Negligible { share_of_cost: merit / cost, least_share })
}

/// The free function number `free`, of which named effects explain the share `explained`, is left; a map corrects it where it
/// can.
pub(super) fn unexplained(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
    free: usize,
    explained: f64,
) -> Event {
    let function = &examination.evidence[free];
    let with_map = function.along.is_some_and(Along::is_of_the_pixel).then(|| {
        let tested = examination.free_functions().count() as f64;
        with_free_map(bench, state, function, (function.p_value * tested).min(1.0))
    });
    Event::Unexplained {
        left_over: LeftOver::free_function(function, explained),
        with_map: with_map.flatten().map(Box::new),
    }
}

/// The model with a free map for a free function, in the form with the smallest held-out depth error. `None` where no form is
/// better than the present model.
fn with_free_map(
    bench: &impl Bench,
    state: &State,
    function: &Evidence,
    p_value: f64,
) -> Option<(AugmentedModel, Fitted)> {
    let State { model, present, .. } = state;
    let rms = |f: &Fitted| f.held_out.errors.depth_rms_mm.unwrap_or(f64::INFINITY);
    let mut best: Option<(AugmentedModel, Fitted)> = None;
    for spec in forms(function.along) {
        let mut options = model.options(bench.declared());
        options.effects.push(spec.clone());
        let fitted = match bench.fitted(&options) {
            Ok(fitted) => fitted,
            Err(error) => {
                info!("{spec} cannot be fitted: {error}");
                continue;
            }
        };
        // A map names no cause: that it may be chance is no reason against it where the error falls.
        let lowest = rms(best.as_ref().map_or(present, |(_, fitted)| fitted));
        if fitted.gain_over(present, &[], bench.thresholds()) != Gain::None && rms(&fitted) < lowest {
            let evidence = Evidence { name: FREE_MAP.to_owned(), spec, ..function.clone() };
            let map = AddedEffect::alone(evidence, p_value, fitted.held_out.clone());
            best = Some((model.clone().with(map), fitted));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{LinearBench, regressor, sum};
    use super::*;
    use crate::diagnose::linear_examination::{Planted, examined, place};

    /// The event for a free function of a covariate that maps of two forms describe, one of them better.
    fn left(along: Along, sizes: [f64; 2]) -> (LinearBench, Event) {
        let (truth, other) = (regressor(1), regressor(2));
        let blurred = sum(&[(0.8, &truth), (0.6, &other)]);
        let bench = LinearBench::new(&[(FREE_MAP, sizes[0], blurred), ("bspline", sizes[1], truth)]);
        let mut examination = examined(Planted { c: 0.4, ..Planted::default() }, 3);
        let free = place(&examination, "free");
        examination.evidence[free].along = Some(along);
        let event = unexplained(&bench, &bench.state(&[]), &examination, free, 0.5);
        (bench, event)
    }

    #[test]
    fn the_map_with_the_smallest_error_corrects_what_is_left() {
        let (bench, event) = left(Along::Pixel, [0.0, 0.5]);
        let mut state = bench.state(&[]);
        state.apply(event);
        assert_eq!(state.model.specs_from(0)[0].name, "bspline");
        assert_eq!(state.model.added[0].evidence.name, FREE_MAP);
        assert_eq!(state.model.added[0].after.errors, state.present.held_out.errors);
        let expected = LeftOver::FreeFunction { along: Along::Pixel, size_mm: 1.0, explained: 0.5 };
        assert_eq!(state.findings.left_over, [expected]);
    }

    #[test]
    fn no_map_is_added_where_none_helps_or_the_pixel_says_nothing() {
        for (along, sizes) in [(Along::Pixel, [0.0, 0.0]), (Along::Depth, [0.0, 0.5])] {
            let (_, event) = left(along, sizes);
            assert!(matches!(event, Event::Unexplained { left_over: Some(_), with_map: None }), "{along:?}");
        }
    }

    #[test]
    fn a_small_free_function_is_negligible() {
        let examination = examined(Planted { c: 0.4, ..Planted::default() }, 3);
        let free = place(&examination, "free");
        let share = merit(&examination.evidence[free]) / examination.cost();
        let least = |least_unexplained_share: f64| Thresholds { least_unexplained_share, ..Thresholds::default() };
        assert_eq!(negligible(&examination, free, &least(0.99 * share)), None);
        let least_share = 1.01 * share;
        let outcome = RoundOutcome::Negligible { share_of_cost: share, least_share };
        assert_eq!(negligible(&examination, free, &least(least_share)), Some(outcome));
    }
}
