//! Decisions on linear problems whose missing effects are known.

use depthcal_model::{On, Placement};

use super::super::linear_examination::{FRAMES, Planted, examined, place, planes, quiet_planes};
use super::*;

/// With a size of a that changes from frame to frame by more than twice its mean: the first of some captures in which a is
/// significant by the usual test, and not by the scatter between frames.
fn shaken(planted: Planted) -> Examination {
    let deceives = |e: &Examination| {
        let a = &e.evidence[place(e, "a")];
        significant(a.p_value, e.tests, &a.gains, &Thresholds::default())
            && a.score.clustered_p_value * e.tests as f64 > Thresholds::default().clustered_level
    };
    let captures = (0..50).map(|seed| examined(Planted { shake: 0.7, ..planted }, 100 + seed));
    captures.into_iter().find(deceives).expect("a capture in which the usual test is deceived")
}

fn decided(e: &Examination, rejected: &[&str], refuted: &[&str]) -> Decision {
    let rejected: Vec<String> = rejected.iter().map(|name| (*name).to_owned()).collect();
    let refuted: Vec<usize> = refuted.iter().map(|name| place(e, name)).collect();
    let ruled_out = RuledOut { rejected: &rejected, refuted: &refuted };
    decide(e, &quiet_planes(), 1e-4, ruled_out, &Thresholds::default())
}

/// Names of the effect that is added, of those jointly with it and instead of it, and whether something is left.
#[track_caller]
fn added(e: &Examination, decision: Decision) -> (String, Vec<String>, Vec<String>, bool) {
    let name = |i: &usize| e.evidence[*i].name.clone();
    match decision {
        Decision::Add { effect, jointly_with, indistinguishable, leaves_unexplained, .. } => {
            (name(&effect), jointly_with.iter().map(name).collect(), indistinguishable, leaves_unexplained)
        }
        other => panic!("{other:?}"),
    }
}

fn alone(name: &str) -> (String, Vec<String>, Vec<String>, bool) {
    (name.to_owned(), Vec::new(), Vec::new(), false)
}

/// 40 seeds: a wrong decision is one in some hundred.
#[test]
fn nothing_is_found_in_noise() {
    let wrong =
        (0..40).filter(|seed| !matches!(decided(&examined(Planted::default(), *seed), &[], &[]), Decision::Nothing));
    assert!(wrong.count() <= 2);
}

#[test]
fn a_missing_effect_is_named() {
    let e = examined(Planted { a: 0.3, ..Default::default() }, 1);
    let decision = decided(&e, &[], &[]);
    let Decision::Add { explained, of_planes, .. } = decision else { panic!("{decision:?}") };
    assert!(explained > 0.95 && of_planes > 1.0, "{explained} {of_planes}");
    assert_eq!(added(&e, decision), alone("a"));
}

#[test]
fn an_effect_that_looks_the_same_is_said() {
    let e = examined(Planted { a: 0.3, with_twin: true, ..Default::default() }, 2);
    let (name, jointly, instead, unexplained) = added(&e, decided(&e, &[], &[]));
    let mut both = vec![name, instead[0].clone()];
    both.sort();
    assert_eq!(
        (both, jointly.len(), instead.len(), unexplained),
        (vec!["a".to_owned(), "twin".to_owned()], 0, 1, false)
    );
}

/// Two effects are told apart if their gains differ from frame to frame, or if one still explains something once the other is in
/// the model. Either is enough.
#[test]
fn effects_that_one_criterion_tells_apart_are_not_alike() {
    let thresholds = Thresholds::default();
    let criteria = |e: &Examination, first: usize, other: usize| {
        let t = mean_to_standard_error(&difference(&e.evidence[first].gains, &e.evidence[other].gains));
        let beside = e.linearization.score_adjusted(e.evidence[first].index, &[e.evidence[other].index]).p_value;
        (t < thresholds.distinguishing_t, beside > thresholds.level)
    };
    let mut e = examined(Planted { a: 0.3, with_twin: true, ..Default::default() }, 2);
    let [a, twin] = ["a", "twin"].map(|name| place(&e, name));
    assert_eq!(criteria(&e, a, twin), (true, true));
    assert_eq!(indistinguishable(&e, a, &[a], &thresholds), [twin]);
    assert!(indistinguishable(&e, a, &[a, twin], &thresholds).is_empty());
    e.evidence[twin].gains = e.evidence[a].gains.iter().map(|gain| 0.5 * gain).collect();
    assert_eq!(criteria(&e, a, twin), (false, true));
    assert!(indistinguishable(&e, a, &[a], &thresholds).is_empty());
    // Two effects of the same size that have nothing to do with each other.
    let e = examined(Planted { a: 0.3, b: 0.3, ..Default::default() }, 4);
    let [a, b] = ["a", "b"].map(|name| place(&e, name));
    assert_eq!(criteria(&e, a, b), (true, false));
    assert!(indistinguishable(&e, a, &[a], &thresholds).is_empty());
}

#[test]
fn what_no_effect_explains_has_no_name() {
    let e = examined(Planted { c: 0.3, ..Default::default() }, 3);
    let decision = decided(&e, &[], &[]);
    let Decision::Unexplained { free, explained, competitor } = decision else { panic!("{decision:?}") };
    assert_eq!((free, explained, competitor), (place(&e, "free"), 0.0, Competitor::FreeFunction));
}

#[test]
fn two_missing_effects_are_added_together() {
    let e = examined(Planted { a: 0.3, b: 0.4, ..Default::default() }, 4);
    assert_eq!(added(&e, decided(&e, &[], &[])), ("b".to_owned(), vec!["a".to_owned()], vec![], false));
    // One that was tried before does not come first again.
    assert_eq!(added(&e, decided(&e, &["b"], &[])), ("a".to_owned(), vec!["b".to_owned()], vec![], false));
    assert_eq!(added(&e, decided(&e, &[], &["b"])).0, "a");
}

#[test]
fn what_was_rejected_or_refuted_is_not_named_again() {
    let e = examined(Planted { a: 0.3, ..Default::default() }, 5);
    assert!(matches!(decided(&e, &["a"], &[]), Decision::Nothing));
    assert!(matches!(decided(&e, &[], &["a"]), Decision::Nothing));
    assert_eq!(added(&e, decided(&e, &["b"], &["b"])), alone("a"));
}

#[test]
fn what_is_too_small_is_no_finding() {
    let e = examined(Planted { a: 0.3, ..Default::default() }, 6);
    // The effect is some 5 % of the cost.
    let share = merit(&e.evidence[0]) / e.cost();
    let with_least = |least: f64| decide(&e, &quiet_planes(), least, RuledOut::default(), &Thresholds::default());
    assert!((0.03..0.1).contains(&share), "{share}");
    assert_eq!(added(&e, with_least(0.99 * share)), alone("a"));
    assert!(matches!(with_least(1.01 * share), Decision::Nothing));
}

/// The effect is there, and so is three times as much that has no name.
#[test]
fn an_effect_beside_something_unexplained_is_named_where_it_holds() {
    let planted = Planted { a: 0.3, c: 0.55, ..Default::default() };
    let e = examined(planted, 7);
    let decision = decided(&e, &[], &[]);
    let Decision::Add { explained, .. } = decision else { panic!("{decision:?}") };
    assert!((0.15..0.4).contains(&explained), "{explained}");
    let (name, jointly, instead, unexplained) = added(&e, decision);
    assert_eq!((name.as_str(), jointly.len(), instead.len(), unexplained), ("a", 0, 0, true));
    // A size that changes from frame to frame by more than its mean is no effect by the scatter between frames.
    let shaken = shaken(planted);
    let decision = decided(&shaken, &[], &[]);
    let Decision::Unexplained { free, explained, competitor } = decision else { panic!("{decision:?}") };
    assert!((0.01..0.75).contains(&explained), "{explained}");
    assert_eq!((free, competitor), (place(&shaken, "free"), Competitor::FreeFunction));
    // One that only resembles what has no name: nothing is left of it given the free function.
    let imitated = examined(Planted { a: 0.0, c: 0.55, a_with_c: 0.6, ..planted }, 9);
    let decision = decided(&imitated, &[], &[]);
    let Decision::Unexplained { free, explained, competitor } = decision else { panic!("{decision:?}") };
    assert!((0.2..0.5).contains(&explained), "{explained}");
    assert_eq!((free, competitor), (place(&imitated, "free"), Competitor::FreeFunction));
    // An effect that is present and correlated with the free function keeps most of its gain when both are fitted.
    let both = examined(Planted { a_with_c: 0.5, ..planted }, 14);
    let (name, _, _, unexplained) = added(&both, decided(&both, &[], &[]));
    assert_eq!((name.as_str(), unexplained), ("a", true));
    // Where the function adds little to an effect that imitates it well, the effect stands.
    let same = examined(Planted { c: 0.55, a_with_c: 0.97, ..Planted::default() }, 10);
    assert_eq!(added(&same, decided(&same, &[], &[])).0, "a");
}

/// A value that is said to be enough is enough: each rule at the very value that this capture has.
#[test]
fn limits_belong_to_what_is_named() {
    let quiet =
        |e: &Examination, thresholds: &Thresholds| decide(e, &quiet_planes(), 1e-4, RuledOut::default(), thresholds);
    let by_default = Thresholds::default();
    let e = examined(Planted { a: 0.3, c: 0.15, ..Default::default() }, 15);
    let decision = quiet(&e, &by_default);
    let Decision::Add { explained, .. } = decision else { panic!("{decision:?}") };
    assert!(
        (0.75..1.0).contains(&explained),
        "{explained}: nothing but the effect explains anything: the test shows nothing"
    );
    for (least_explained, expected) in [(explained, false), (explained + 1e-9, true)] {
        assert_eq!(added(&e, quiet(&e, &Thresholds { least_explained, ..by_default })).3, expected);
    }
    let decision = decide(&e, &planes(6.0), 1e-4, RuledOut::default(), &by_default);
    let Decision::Add { of_planes, .. } = decision else { panic!("{decision:?}") };
    for (least_explained_of_planes, expected) in [(of_planes, false), (of_planes + 1e-9, true)] {
        let thresholds = Thresholds { least_explained_of_planes, ..by_default };
        assert_eq!(added(&e, decide(&e, &planes(6.0), 1e-4, RuledOut::default(), &thresholds)).3, expected);
    }
    // While something stays unexplained, an effect is named only if it is significant by the scatter between frames and explains
    // a minimum share of the cost.
    let e = examined(Planted { a: 0.3, c: 0.55, ..Default::default() }, 7);
    let names_a = |thresholds: &Thresholds| match quiet(&e, thresholds) {
        Decision::Add { effect, leaves_unexplained, .. } => leaves_unexplained && effect == place(&e, "a"),
        _ => false,
    };
    let a = &e.evidence[place(&e, "a")];
    let level = a.score.clustered_p_value * e.tests as f64;
    assert!(!names_a(&Thresholds { clustered_level: level, ..by_default }));
    assert!(names_a(&Thresholds { clustered_level: 1.01 * level, ..by_default }));
    let share = merit(a) / e.cost();
    assert!(!names_a(&Thresholds { least_named_share: 1.01 * share, ..by_default }));
    assert!(names_a(&Thresholds { least_named_share: 0.99 * share, ..by_default }));
}

/// Frames that deviate by planes of their own, more than the effect accounts for.
#[test]
fn planes_of_frames_compete_with_effects() {
    let e = examined(Planted { a: 0.3, ..Default::default() }, 11);
    let statistic = e.evidence[place(&e, "a")].score.statistic;
    // Half the effect's statistic, over the planes' gain less 1.5 standard deviations of noise, ½ √(6 n).
    let share = |of_plane: f64| {
        let n = FRAMES as f64;
        0.5 * statistic / (0.5 * n * (of_plane - 3.0) - 1.5 * 0.5 * (6.0 * n).sqrt())
    };
    let decided = |of_plane: f64| decide(&e, &planes(of_plane), 1e-4, RuledOut::default(), &Thresholds::default());
    // The statistic of the planes at which the share is 0.7.
    let limit = 3.0 + (statistic / 0.7 + 1.5 * (6.0 * FRAMES as f64).sqrt()) / FRAMES as f64;
    for of_plane in [limit * 0.99, limit * 1.01] {
        let decision = decided(of_plane);
        let Decision::Add { of_planes, .. } = decision else { panic!("{decision:?}") };
        let (name, _, _, unexplained) = added(&e, decision);
        assert_eq!((name.as_str(), unexplained), ("a", of_plane > limit));
        // As a reason to look further the planes count whole.
        let expected = if unexplained { statistic / (FRAMES as f64 * (of_plane - 3.0)) } else { share(of_plane) };
        assert!((of_planes / expected - 1.0).abs() < 1e-9, "{of_planes} {expected}");
    }
    // The free function gains only a quarter more than this effect alone, so the effect is named as well.
    let same = examined(Planted { c: 0.55, a_with_c: 0.8_f64.sqrt(), ..Default::default() }, 17);
    let decision = decide(&same, &planes(200.0), 1e-4, RuledOut::default(), &Thresholds::default());
    assert_eq!(added(&same, decision), ("a".to_owned(), Vec::new(), Vec::new(), true));
    let shaken = shaken(Planted { a: 0.3, ..Default::default() });
    let decision = decide(&shaken, &planes(200.0), 1e-4, RuledOut::default(), &Thresholds::default());
    let Decision::Unexplained { free, explained, competitor } = decision else { panic!("{decision:?}") };
    assert!(explained < 0.1, "{explained}");
    assert_eq!((free, competitor), (place(&shaken, "free"), Competitor::FramePlanes));
}

/// Of two effects that cannot be told apart the one in the form of its own equation, unless that one was tried.
#[test]
fn the_form_of_an_effect_s_own_equation_is_preferred() {
    let mut e = examined(Planted { a: 0.3, with_twin: true, ..Default::default() }, 13);
    let placement = Placement { on: Some(On::Factor), ..Placement::default() };
    let best = if e.evidence[0].name == "a" { ["a", "twin"] } else { ["twin", "a"] };
    e.evidence[0].spec.placement = placement;
    assert_eq!(added(&e, decided(&e, &[], &[])).0, best[1]);
    assert_eq!(added(&e, decided(&e, &[best[1]], &[])).0, best[0]);
    assert_eq!(added(&e, decided(&e, &[], &[best[1]])).0, best[0]);
    // Not another form again, and not one of more parameters.
    let second = place(&e, best[1]);
    e.evidence[second].score.rank = 2;
    assert_eq!(added(&e, decided(&e, &[], &[])).0, best[0]);
    e.evidence[second].score.rank = 1;
    e.evidence[second].spec.placement = placement;
    assert_eq!(added(&e, decided(&e, &[], &[])).0, best[0]);
}
