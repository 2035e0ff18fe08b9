//! The term that is chosen: constants refined, compared on left-out frames, the simpler of equals, extended and reduced.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::{Of, On};
use depthcal_statistics::mean_to_standard_error;
use rayon::prelude::*;

use super::library::{Function, Kind};
use super::observations::Observations;
use super::score::{Score, held_out_gains};
use super::screened::Screened;
use super::term::{Product, Term};

/// Terms of one set of covariates that are compared on left-out frames, where there are other sets, and where there are none.
const OF_ONE_SET: usize = 6;
const OF_THE_SET: usize = 16;
/// Sets of covariates that are compared.
const SETS: usize = 14;
/// Steps of the search for a constant, each of which shortens its interval by the golden ratio.
const GOLDEN_STEPS: usize = 12;
/// Parameters of a formula.
const MOST_COLUMNS: usize = 3;
/// Share of its gain by which a further product must raise it …
const LEAST_RISE: f64 = 0.08;
/// … and how certain the rise has to be, in standard errors over frames.
const LEAST_RISE_T: f64 = 3.0;
/// A simpler term wins where it is worse by less than this many standard errors over frames and explains this share of what the
/// better one does, or where it is worse by less than the second share.
const TIE_T: f64 = 1.0;
const LEAST_TIE_SHARE: f64 = 0.9;
const TIE_SHARE: f64 = 0.02;

/// A term with its gain on every frame when it is estimated from all others.
#[derive(Debug, Clone)]
pub(super) struct Judged {
    pub term: Term,
    pub gains: Vec<f64>,
}

impl Judged {
    /// A term with the constants that it has.
    pub fn new(observations: &Observations, term: Term) -> Self {
        let gains = held_out_gains(&observations.normals(&term), observations.shared, None);
        Self { term, gains }
    }

    /// A term with the constant that fits best.
    pub fn refined(observations: &Observations, term: Term) -> Self {
        Self::new(observations, refined(observations, term))
    }

    /// Sum of the gains.
    pub fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }

    /// Gain that is lost on every frame with another one instead.
    pub fn lost_by(&self, other: &Self) -> Vec<f64> {
        self.gains.iter().zip(&other.gains).map(|(own, other)| own - other).collect()
    }

    /// Whether it is as good as another one.
    fn is_as_good_as(&self, other: &Self) -> bool {
        let share = self.gain() / other.gain();
        share >= 1.0 - TIE_SHARE || (share >= LEAST_TIE_SHARE && mean_to_standard_error(&other.lost_by(self)) < TIE_T)
    }
}

/// Terms to choose from, the best of each set of covariates first; `order` are the screened ones by merit.
pub(super) fn compared(observations: &Observations, order: &[&Screened]) -> Vec<Judged> {
    let mut judged = compared_by_set(observations, order, OF_ONE_SET);
    judged.extend(sums(observations, order));
    judged.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    judged
}

/// Terms to choose from where their covariates are known, the best first.
pub(super) fn compared_of_set(observations: &Observations, order: &[&Screened], set: &BTreeSet<C>) -> Vec<Judged> {
    let of_set: Vec<&Screened> = order.iter().copied().filter(|s| s.term.families() == *set).collect();
    let mut judged = compared_by_set(observations, &of_set, OF_THE_SET);
    judged.extend(sums(observations, order).into_iter().filter(|sum| sum.term.families() == *set));
    judged.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    judged
}

/// The best terms of each set of covariates, refined.
fn compared_by_set(observations: &Observations, order: &[&Screened], of_one_set: usize) -> Vec<Judged> {
    // The best of each kind for every set of families, in the order of their merit.
    let mut sets: BTreeMap<BTreeSet<C>, Vec<&Screened>> = BTreeMap::new();
    let mut first: Vec<BTreeSet<C>> = Vec::new();
    for candidate in order {
        let families = candidate.term.families();
        if !first.contains(&families) {
            if first.len() == SETS {
                continue;
            }
            first.push(families.clone());
        }
        let members = sets.entry(families).or_default();
        let alike = |other: &&Screened| key(&other.term) == key(&candidate.term);
        if members.len() < of_one_set && !members.iter().any(alike) {
            members.push(candidate);
        }
    }
    let terms: Vec<Term> = sets.into_values().flatten().map(|s| s.term.clone()).collect();
    terms.into_par_iter().map(|term| Judged::refined(observations, term)).collect()
}

/// Screened terms, those that explain most first.
pub(super) fn by_merit<'a>(screened: impl IntoParallelIterator<Item = &'a Screened>) -> Vec<&'a Screened> {
    let mut order: Vec<(f64, &Screened)> = screened.into_par_iter().map(|s| (s.merit(|_| 1.0), s)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    order.into_iter().map(|(_, s)| s).collect()
}

/// The term that is chosen of those with the covariates of `families`, or of all, extended by further products.
pub(super) fn choose(
    observations: &Observations,
    order: &[&Screened],
    judged: &[Judged],
    families: Option<&BTreeSet<C>>,
) -> Option<Judged> {
    let members: Vec<&Judged> =
        judged.iter().filter(|j| families.is_none_or(|families| j.term.families() == *families)).collect();
    Some(extended(observations, simplest(&members)?.clone(), order))
}

/// The terms that explain most, each extended by further products.
pub(super) fn best_extended<'a>(
    observations: &'a Observations,
    order: &'a [&Screened],
    judged: &'a [Judged],
) -> impl Iterator<Item = Judged> + 'a {
    judged.iter().take(EXTENDED).map(|judged| extended(observations, judged.clone(), order))
}

/// Terms that are extended where the simplest explains too little.
const EXTENDED: usize = 3;

/// Plain functions that are summed in pairs.
const SUMMED: usize = 16;
/// Sums that are compared on left-out frames.
const SUMS: usize = 6;

/// The best sums of two functions without searched constants, of different covariates, in one place and form: neither may explain
/// much without the other. One of them may be an offset; the sum of both directions in the image may have one too.
fn sums(observations: &Observations, order: &[&Screened]) -> Vec<Judged> {
    let mut plain: Vec<&Term> = Vec::new();
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    for candidate in order {
        let (term, product) = (&candidate.term, &candidate.term.products[0]);
        let is_plain = product.factor.is_none() && !product.function.kind.is_searched();
        let of_place = count.entry(format!("{:?} {:?}", term.of, term.on)).or_default();
        if is_plain && *of_place < SUMMED {
            *of_place += 1;
            plain.push(term);
        }
    }
    let mut pairs: Vec<Term> = Vec::new();
    for (i, first) in plain.iter().enumerate() {
        for second in &plain[i + 1..] {
            if (first.of, first.on) == (second.of, second.on) && first.families() != second.families() {
                pairs.push(Term { products: [&first.products[..], &second.products].concat(), ..(*first).clone() });
            }
        }
    }
    pairs.extend(plain.iter().map(|term| with_offset(term)));
    for of in Of::ALL {
        for on in On::ALL {
            let inclined = Term { of, on, products: [C::X, C::Y].map(Product::linear).to_vec() };
            pairs.push(with_offset(&inclined));
            pairs.push(inclined);
        }
    }
    let mut scored: Vec<(f64, Term)> = pairs
        .into_par_iter()
        .filter_map(|term| {
            let score = Score::of(&observations.normals(&term), observations.shared)?;
            Some((score.statistic(|_| 1.0), term))
        })
        .collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored.truncate(SUMS);
    scored.into_par_iter().map(|(_, term)| Judged::new(observations, term)).collect()
}

/// A term with an offset in addition.
fn with_offset(term: &Term) -> Term {
    Term { products: [&term.products[..], &[Product::OFFSET]].concat(), ..term.clone() }
}

/// Terms with equal keys differ in their constants only.
fn key(term: &Term) -> (depthcal_model::Of, depthcal_model::On, Option<(C, Kind)>, C, Kind) {
    let product = &term.products[0];
    let factor = product.factor.map(|f| (f.covariate, f.kind));
    (term.of, term.on, factor, product.function.covariate, product.function.kind)
}

/// Of all that are as good as the best, the one of the fewest covariates, then the simplest, then the best.
fn simplest<'a>(judged: &[&'a Judged]) -> Option<&'a Judged> {
    let best = *judged.first().filter(|best| best.gain() > 0.0)?;
    let near = judged.iter().copied().filter(|other| other.gain() > 0.0 && other.is_as_good_as(best));
    near.min_by(|a, b| {
        let effort = |j: &Judged| (j.term.families().len(), j.term.complexity());
        effort(a).cmp(&effort(b)).then(b.gain().total_cmp(&a.gain()))
    })
}

/// The term with those constants of its last product that fit best, within the neighbours of their grids.
fn refined(observations: &Observations, term: Term) -> Term {
    let last = term.products.len() - 1;
    let Product { factor, function } = term.products[last];
    let of_function = |term: Term| {
        let with = |value| term.with_constant(last, value);
        best_constant(observations, &function, factor.is_some(), term.of, with).unwrap_or(term.clone())
    };
    let term = of_function(term);
    let with = |value| term.with_factor_constant(last, value);
    match factor.and_then(|factor| best_constant(observations, &factor, true, term.of, with)) {
        Some(term) => of_function(term),
        None => term,
    }
}

/// The term with the constant of a function that fits best, of those that `with` makes; `None` where its constant is not
/// searched.
fn best_constant(
    observations: &Observations,
    function: &Function,
    is_coarse: bool,
    of: Of,
    with: impl Fn(f64) -> Term,
) -> Option<Term> {
    if !function.kind.is_searched() {
        return None;
    }
    let span = observations.span(function.covariate, of)?;
    let k = function.constant;
    // Waves are tried at equal steps of frequency, lengths of decay at ratios, all others at equal steps.
    let (low, high) = match function.kind {
        Kind::Wave => {
            let step = if is_coarse { 0.75 } else { 0.4 };
            let cycles = span.length() / k;
            ((cycles - step).max(0.2), cycles + step)
        }
        Kind::Decay | Kind::Settling | Kind::Ratio | Kind::Log => ((k / 2.0).ln(), (2.0 * k).ln()),
        _ => {
            let step = span.length() / if is_coarse { 6.0 } else { 12.0 };
            (k - step, k + step)
        }
    };
    let constant = |t: f64| match function.kind {
        Kind::Wave => span.length() / t,
        Kind::Decay | Kind::Settling | Kind::Ratio | Kind::Log => t.exp(),
        _ => t,
    };
    let merit = |t: f64| {
        let normals = observations.normals(&with(constant(t)));
        Score::of(&normals, observations.shared).map_or(0.0, |score| score.statistic(|_| 1.0))
    };
    Some(with(constant(golden(low, high, merit))))
}

/// Place of the maximum of a function with a single one in an interval (golden section; Kiefer 1953).
fn golden(mut low: f64, mut high: f64, value: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut of_a, mut of_b) = (value(a), value(b));
    for _ in 0..GOLDEN_STEPS {
        if of_a > of_b {
            (high, b, of_b) = (b, a, of_a);
            a = high - ratio * (high - low);
            of_a = value(a);
        } else {
            (low, a, of_a) = (a, b, of_b);
            b = low + ratio * (high - low);
            of_b = value(b);
        }
    }
    if of_a > of_b { a } else { b }
}

/// Terms that are tried as a further product.
const FURTHER: usize = 6;

/// The term with further products of its own covariates, the other axis of the image or none, in its place and form, while they
/// raise the gain for certain; then without those that became needless.
fn extended(observations: &Observations, chosen: Judged, order: &[&Screened]) -> Judged {
    let mut allowed = chosen.term.families();
    // A direction in the image is as likely between its axes as along one.
    if allowed.contains(&C::X) || allowed.contains(&C::Y) {
        allowed.extend([C::X, C::Y]);
    }
    let mut present = chosen;
    while present.term.columns() < MOST_COLUMNS {
        let room = MOST_COLUMNS - present.term.columns();
        let fits = |other: &Term| {
            let has_constant = present.term.searched().is_some() && other.searched().is_some();
            (other.of, other.on) == (present.term.of, present.term.on)
                && other.columns() <= room
                && !has_constant
                && other.families().is_subset(&allowed)
                && !present.term.products.contains(&other.products[0])
        };
        let offset = Term { products: vec![Product::OFFSET], ..present.term.clone() };
        let terms = order.iter().map(|s| &s.term);
        let alike: Vec<Term> = std::iter::once(&offset).chain(terms).filter(|t| fits(t)).cloned().collect();
        // Terms that explain most alone may add little to the present one, so each is scored together with it.
        let mut scored: Vec<(f64, Term)> = alike
            .into_par_iter()
            .take(MOST_SCORED)
            .filter_map(|other| {
                let mut term = present.term.clone();
                term.products.extend(other.products);
                let score = Score::of(&observations.normals(&term), observations.shared)?;
                Some((score.statistic(|_| 1.0), term))
            })
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        scored.truncate(FURTHER);
        let judged = scored.into_par_iter().map(|(_, term)| Judged::refined(observations, term));
        let best = judged.collect::<Vec<_>>().into_iter().max_by(|a, b| a.gain().total_cmp(&b.gain()));
        let Some(best) = best else { break };
        let certain = mean_to_standard_error(&best.lost_by(&present)) > LEAST_RISE_T;
        if !(certain && best.gain() > (1.0 + LEAST_RISE) * present.gain()) {
            break;
        }
        present = best;
    }
    reduced(observations, present)
}

/// The term without products that hardly raise its gain over that of its offset alone.
fn reduced(observations: &Observations, mut present: Judged) -> Judged {
    let offset = Term { products: vec![Product::OFFSET], ..present.term.clone() };
    while present.term.products.len() > 1 {
        let of_offset = match present.term.products.contains(&Product::OFFSET) {
            true => Judged::new(observations, offset.clone()).gain().max(0.0),
            false => 0.0,
        };
        let without = |i: usize| {
            let mut term = present.term.clone();
            term.products.remove(i);
            (term != offset).then(|| Judged::new(observations, term))
        };
        let all = (0..present.term.products.len()).filter_map(without);
        let Some(best) = all.max_by(|a, b| a.gain().total_cmp(&b.gain())) else { break };
        let rise = (present.gain() - of_offset) / (best.gain() - of_offset).max(f64::MIN_POSITIVE);
        if rise > 1.0 + LEAST_RISE {
            break;
        }
        present = best;
    }
    present
}

/// Terms that are scored jointly with the present one.
const MOST_SCORED: usize = 300;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_golden_section_finds_a_maximum() {
        let maximum = golden(-3.0, 5.0, |t| -(t - 1.234) * (t - 1.234));
        assert!((maximum - 1.234).abs() < 0.02, "{maximum}");
    }
}
