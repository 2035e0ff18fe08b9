//! The first screen of a diagnosis: headline, verdict, and questions with answers.

use depthcal_io::{DiagnosisCandidate, DiagnosisStep, GainInterval, Spread, Verdict};

use super::remedies::remedy;
use super::sentences::{
    capture, covariate, declaration, left_over, possible, pure_noise, rivals_of_other_technologies, searched,
};
use crate::checks::Level;
use crate::format::{self, capital, count, join, number, percent, quantity};
use crate::headline::certainty;
use crate::input::{ReportCamera, ReportDiagnosis};
use crate::left_out;
use crate::parameters::summary;
use crate::pool::Pool;
use depthcal_calibration::judge::intervals::{self, Change};
use depthcal_model::{ModelSpec, PieceSpec};

/// Free functions are named if they lower the weighted residual by more than this, per cent.
const WORTH_PERCENT: f64 = 0.5;
/// Names of effects in the headline, where at least two more would follow.
const HEADLINE_NAMES: usize = 3;
/// Causes that are told with what a person can do, and steps that are told with all their numbers, where there are more.
const TOLD: usize = 3;
/// Words for what a formula describes.
const WITHOUT_CAUSE: &str = "functions without a known cause describe the rest";
/// Most recommendations of captures on the first screen.
const NEXT: usize = 3;

/// A question that a reader has, and its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    pub question: &'static str,
    pub answer: String,
    /// Id of the section with the details.
    pub more: &'static str,
}

/// The declared model in words: `K, lens and D`, or its name.
fn declared_model(d: &ReportDiagnosis<'_>) -> String {
    if d.record.model.is_none() {
        "K and lens without a depth model".to_owned()
    } else if d.record.model == ModelSpec::of(PieceSpec::new("projective")) {
        "K, lens and D".to_owned()
    } else {
        format!("the declared model ({})", d.register.model_words(&d.record.model))
    }
}

fn with_interval(change: &Change) -> String {
    format!("{} mm rms ({})", number(change.before.value), certainty(&change.before, "mm", change.frames))
}

/// Names of steps.
fn names<'a>(steps: &[&'a DiagnosisStep]) -> Vec<&'a str> {
    steps.iter().filter_map(|step| step.effects.first().map(String::as_str)).collect()
}

/// The first names, and how many more there are.
fn join_some(names: &[&str]) -> String {
    let more = names.len().saturating_sub(HEADLINE_NAMES);
    // "One more" would be no shorter than its name.
    if more < 2 {
        return join(names);
    }
    format!("{} and {} more", names[..HEADLINE_NAMES].join(", "), count(more, "effect"))
}

/// The headline: depth error as measured, under the declared model, and under the last one.
pub(crate) fn sentence(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> String {
    let Some(change) = Pool::last(camera).depth_rms() else {
        return "No frame with depth could be evaluated.".to_owned();
    };
    let declared = Pool::declared(d).depth_rms().map_or(f64::NAN, |c| c.after.value);
    let sure = certainty(&change.after, "mm", change.frames);
    let model = declared_model(d);
    let added = names(&d.steps_by_certainty(true));
    let (raw, now) = (number(change.before.value), number(change.after.value));
    match (d.record.verdict, added.is_empty()) {
        (Verdict::Adequate, _) => format!(
            "The depth error was {raw} mm rms as measured, relative to the board's pose. With {model} it is {now} mm on held-out frames ({sure}), and \
             these captures show nothing that is missing.",
        ),
        (_, true) if !d.record.steps.is_empty() => format!(
            "The depth error was {raw} mm rms as measured, relative to the board's pose. With the last model it is {now} mm on held-out frames \
             ({sure}); no single effect lowers it for certain.",
        ),
        (_, true) => format!(
            "The depth error was {raw} mm rms as measured, relative to the board's pose. With {model} it is {now} mm on held-out frames ({sure}): \
             something is left that no known effect explains."
        ),
        (_, false) => format!(
            "The depth error was {raw} mm rms as measured, relative to the board's pose. With {model} it is {} mm on held-out frames; with {} it is \
             {now} mm ({sure}).",
            number(declared),
            join_some(&added)
        ),
    }
}

/// The verdict in a few words, and its level.
pub(crate) fn pill(d: &ReportDiagnosis<'_>) -> (Level, String) {
    let frames = d.record.bad_frames.len();
    let declarations = d.record.declarations.len();
    let (level, text) = match d.record.verdict {
        Verdict::Adequate => (Level::Good, "Adequate: nothing is missing that these captures can show"),
        Verdict::Effect => (Level::Good, "Effect: what was missing was found and added; nothing else is left"),
        Verdict::Unexplained if d.record.lacks_only_causes() => {
            (Level::Care, "Unexplained: nothing else is left, but the cause of a function is not known")
        }
        Verdict::Unexplained => (Level::Care, "Unexplained: something is left that no known effect explains"),
    };
    if declarations > 0 {
        return (Level::Bad, "Check the dataset file: board size or depth unit cannot be right".to_owned());
    }
    let out = if frames > 0 { format!(" · {} excluded", count(frames, "frame")) } else { String::new() };
    (level, format!("{text}{out}"))
}

/// All questions with their answers; `coverage` lists gaps in the coverage of image, distances and tilts.
pub(crate) fn answers(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>, coverage: &[String]) -> Vec<Answer> {
    let new = |question, answer: String, more| Answer { question, answer, more };
    let mut list = Vec::new();
    if !d.record.declarations.is_empty() {
        list.push(new("Is the dataset file right?", sentences(&words(&d.record.declarations, declaration)), "next"));
    }
    list.push(new("How wrong was the depth?", how_wrong(camera), "datasets"));
    list.push(new("Where?", place(camera, d), "where"));
    list.push(new("Why?", why(d), "candidates"));
    list.push(new("What was added?", added(d), "steps"));
    list.push(new("How wrong is it now?", now(camera, d), "where"));
    list.push(new("How certain is that?", sure(camera, d), "trust"));
    list.push(new("What to capture next?", next(d, coverage), "next"));
    list
}

fn how_wrong(camera: &ReportCamera<'_>) -> String {
    let pool = Pool::last(camera);
    let Some(depth) = pool.depth_rms() else { return "No depth could be evaluated.".to_owned() };
    let mut text = format!("As measured by {}, relative to the board's pose", with_interval(&depth));
    if let Some(plane) = pool.plane_error() {
        text += &format!("; the mean plane error is {} mm", number(plane.before.value));
    }
    text += ".";
    if let Some(outliers) = pool.outliers() {
        text += &format!(" {}", left_out::sentence(&outliers));
    }
    text
}

fn place(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> String {
    let pool = Pool::last(camera);
    let Some(Spread { low, high }) = intervals::spread(pool.pixels().map(|p| p.before_mm)) else {
        return "No depth could be evaluated.".to_owned();
    };
    let side = match (low > 0.0, high < 0.0) {
        (true, _) => "nearly everywhere too far",
        (_, true) => "nearly everywhere too near",
        _ => "both too near and too far",
    };
    let mut text = format!("As measured {side}: {} for 90 % of the pixels.", format::interval(low, high, "mm"));
    let Some(round) = d.record.rounds.first() else { return text };
    let mut seen: Vec<&str> = Vec::new();
    let mut words: Vec<String> = Vec::new();
    for free in round.free.iter().filter(|f| f.held_out_gain_percent > WORTH_PERCENT) {
        let Some(name) = free.along.map(covariate) else { continue };
        if !seen.contains(&name) && seen.len() < 3 {
            seen.push(name);
            words.push(format!("{name} ({})", percent(free.held_out_gain_percent)));
        }
    }
    text += &if words.is_empty() {
        " The errors under the declared model depend on no known quantity.".to_owned()
    } else {
        format!(
            " The errors under the declared model depend on {} (in brackets: how much a free function of it lowers the \
             residual of held-out frames).",
            join(&words)
        )
    };
    text
}

/// Significant effects in plain words, those that gain most with what a person can do about them.
fn why(d: &ReportDiagnosis<'_>) -> String {
    let mut certain = d.steps_by_certainty(true);
    let gain = |step: &DiagnosisStep| step.gain().map_or(0.0, |gain| gain.value);
    certain.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let mut parts = causes(d, &certain);
    if parts.is_empty() {
        parts.push(match d.record.verdict {
            Verdict::Adequate => "The declared model describes it; no known effect is missing".to_owned(),
            _ => "Unknown: no known effect certainly explains the errors under the declared model".to_owned(),
        });
    }
    for step in certain {
        if !step.indistinguishable.is_empty() {
            parts.push(format!(
                "these captures cannot distinguish {} from {}",
                step.effects[0],
                join(&step.indistinguishable)
            ));
        }
        // Effects may have the same rivals.
        parts.extend(rivals_of_other_technologies(step).filter(|rivals| !parts.contains(rivals)));
    }
    sentences(&parts)
}

/// The causes that steps name, with their sizes, the first with remedies. Causes of one remedy share a sentence, and so do all
/// functions without a known cause.
fn causes(d: &ReportDiagnosis<'_>, steps: &[&DiagnosisStep]) -> Vec<String> {
    let mut sentences: Vec<Causes<'_>> = Vec::new();
    for step in steps {
        let name = step.effects.first().map_or("", String::as_str);
        let size = if step.size_mm > 0.0 { format!(", {} rms", quantity(step.size_mm, "mm")) } else { String::new() };
        let cause = if step.formula.is_some() { WITHOUT_CAUSE } else { summary(d.register, name) };
        let remedy = remedy(name).unwrap_or_default();
        let place = sentences.iter().position(|sentence| sentence.takes(cause, remedy)).unwrap_or_else(|| {
            sentences.push(Causes { remedy, causes: Vec::new() });
            sentences.len() - 1
        });
        sentences[place].add(cause, format!("{name}{size}"));
    }
    let all = sentences.len() <= TOLD + 1;
    sentences.iter().enumerate().map(|(number, sentence)| sentence.words(all || number < TOLD)).collect()
}

/// The causes in a sentence.
struct Causes<'a> {
    /// Empty where nothing can be done.
    remedy: &'a str,
    /// Each with its effects.
    causes: Vec<(&'a str, Vec<String>)>,
}

impl<'a> Causes<'a> {
    fn takes(&self, cause: &str, remedy: &str) -> bool {
        self.remedy == remedy && (!remedy.is_empty() || self.causes.iter().any(|(words, _)| *words == cause))
    }

    fn add(&mut self, cause: &'a str, effect: String) {
        match self.causes.iter_mut().find(|(words, _)| *words == cause) {
            Some((_, effects)) => effects.push(effect),
            None => self.causes.push((cause, vec![effect])),
        }
    }

    fn words(&self, with_remedy: bool) -> String {
        let words: Vec<String> =
            self.causes.iter().map(|(cause, effects)| format!("{cause} ({})", effects.join("; "))).collect();
        let remedy = if with_remedy && !self.remedy.is_empty() { format!(": {}", self.remedy) } else { String::new() };
        format!("{}{remedy}", join(&words))
    }
}

/// A change of the depth error: `16.5 % less (95 % interval 13.5 to 20.1 %)`.
pub(crate) fn gain(g: &GainInterval) -> String {
    let way = if g.value >= 0.0 { "less" } else { "more" };
    let unsure = if g.is_certain() { "" } else { ", not significant" };
    format!("{} {way} (95 % interval {}{unsure})", percent(g.value.abs()), format::interval(g.low, g.high, "%"))
}

/// An error before and after: `6.60 → 5.51 mm`.
pub(crate) fn arrow(before: Option<f64>, after: Option<f64>, unit: &str) -> String {
    let show = |v: Option<f64>| number(v.unwrap_or(f64::NAN));
    format!("{} → {} {unit}", show(before), show(after))
}

/// One step in a sentence.
fn step_words(step: &DiagnosisStep) -> String {
    let change = arrow(step.before.depth_rms_mm, step.after.depth_rms_mm, "mm");
    let size = if step.size_mm > 0.0 { format!(" ({} mm rms)", number(step.size_mm)) } else { String::new() };
    let given = if step.gain_percent.is_some() { "; given all others, the error on left-out frames is" } else { "," };
    let gain = step.gain().as_ref().map_or(String::new(), |g| format!("{given} {}", gain(g)));
    format!("{}{size}: {change}{gain}.", step.effects.first().map_or("", String::as_str))
}

fn added(d: &ReportDiagnosis<'_>) -> String {
    if d.record.steps.is_empty() {
        let tested = d.record.rounds.first().map_or(0, |r| r.effects.len());
        return format!("Nothing; {} were tested.{}", count(tested, "effect"), not_certain(d));
    }
    let certain = d.steps_by_certainty(true);
    let words = if certain.len() > TOLD {
        errors_along(&certain)
    } else {
        certain.into_iter().map(step_words).collect::<Vec<_>>().join(" ")
    };
    format!("{words}{}", not_certain(d)).trim_start().to_owned()
}

/// The held-out depth error after every one of many steps, in one sentence.
fn errors_along(steps: &[&DiagnosisStep]) -> String {
    let error = |mm: Option<f64>| number(mm.unwrap_or(f64::NAN));
    let along = |step: &&DiagnosisStep| {
        format!("with {} {}", step.effects.first().map_or("", String::as_str), error(step.after.depth_rms_mm))
    };
    let words: Vec<String> = steps.iter().map(along).collect();
    let before = steps.first().and_then(|step| step.before.depth_rms_mm);
    format!(
        "The depth error on held-out frames was {} mm; {} mm. The gain of each, given all others, is in the chart.",
        error(before),
        join(&words)
    )
}

/// Effects that may be missing, and those that were added although their gain may be chance, with a space before; empty where
/// there are none.
fn not_certain(d: &ReportDiagnosis<'_>) -> String {
    let mut words: Vec<String> = d.record.possible.iter().map(|effect| possible(effect, d.register)).collect();
    let added = d.steps_by_certainty(false);
    words.extend(added.into_iter().map(|step| step_words(step).trim_end_matches('.').to_owned()));
    if words.is_empty() { String::new() } else { format!(" Possible, but not certain: {}.", words.join(". ")) }
}

/// The part of the error that no model could remove, with a space before; empty where that is not known.
fn pure_error(d: &ReportDiagnosis<'_>) -> String {
    d.record.pure_error.as_ref().map_or_else(String::new, |found| {
        let noise = found.noise.as_ref().map_or_else(String::new, |noise| format!(" {}.", capital(&pure_noise(noise))));
        format!(
            " Over the fitted frames {} mm rms is left, of which {} mm is pure error (ratio {}): different frames do not share it at the same \
             value of a covariate, so that no function of one covariate could remove it.{noise}",
            number(found.residual_rms_mm),
            number(found.pure_error_mm),
            number(found.ratio)
        )
    })
}

fn now(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> String {
    let pool = Pool::last(camera);
    let Some(depth) = pool.depth_rms() else { return "No depth could be evaluated.".to_owned() };
    let dots =
        pool.dot_error().map_or(String::new(), |c| format!("; the mean dot error is {} mm", number(c.after.value)));
    let mut text = format!("By {} mm rms{dots}.", number(depth.after.value));
    if !d.record.left_over.is_empty() {
        text += &format!(" Left: {}", sentences(&words(&d.record.left_over, left_over)));
    }
    if let Some(functions) = &d.record.searched {
        text += &format!(" Tried on what is left: {}.", searched(functions));
    }
    text + &pure_error(d)
}

fn sure(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> String {
    let pool = Pool::last(camera);
    let Some(depth) = pool.depth_rms() else { return "Unknown: no depth could be evaluated.".to_owned() };
    let sure = certainty(&depth.after, "mm", depth.frames);
    let mut text = format!("{}, each evaluated by a fit without it.", capital(&sure));
    if let Some(least) = smallest(d, depth.before.value) {
        text += &format!(" {least}");
    }
    text
}

/// Effects whose detectable sizes the first screen names, the first three of those that were tested.
const NAMED: [&str; 7] = [
    "cyclic_depth",
    "disparity_ripple",
    "board_bow",
    "range_offset",
    "reflectivity_bias",
    "projector_distortion",
    "quadratic_depth",
];

/// Whether captures show an effect at a size that it can have: one below the depth error as measured, of which it is a part.
pub(crate) fn is_testable(c: &DiagnosisCandidate, measured_mm: f64) -> bool {
    c.minimal_detectable_mm.is_some_and(|size| size > 0.0 && size < measured_mm)
}

/// From which sizes on effects are seen, and which are not testable.
fn smallest(d: &ReportDiagnosis<'_>, measured_mm: f64) -> Option<String> {
    let round = d.record.rounds.last()?;
    let (seen, blind): (Vec<_>, Vec<_>) = round.effects.iter().partition(|c| is_testable(c, measured_mm));
    let size =
        |c: &DiagnosisCandidate| c.minimal_detectable_mm.map(|mm| format!("{} from {}", c.effect, quantity(mm, "mm")));
    let chosen = NAMED
        .iter()
        .filter_map(|name| seen.iter().find(|c| c.effect == *name))
        .chain(seen.iter().filter(|c| !NAMED.contains(&c.effect.as_str())));
    let sizes: Vec<String> = chosen.take(3).filter_map(|c| size(c)).collect();
    let mut parts = Vec::new();
    if !sizes.is_empty() {
        parts.push(format!("further effects would be seen, among them {}", join(&sizes)));
    }
    if !blind.is_empty() {
        let names: Vec<&str> = blind.iter().map(|c| c.effect.as_str()).collect();
        let listed = if names.len() > 4 { count(names.len(), "effect") } else { join(&names) };
        parts.push(format!("not testable with these captures: {listed}"));
    }
    (!parts.is_empty()).then(|| sentences(&parts))
}

/// Captures to make next: first what separates effects, then gaps in the coverage.
fn next(d: &ReportDiagnosis<'_>, coverage: &[String]) -> String {
    let proposals = d.record.capture_next.iter().take(NEXT).map(capture);
    let list: Vec<String> = proposals.chain(coverage.iter().cloned()).collect();
    if list.is_empty() {
        return "Nothing in particular: these captures separate the effects and cover the image and the distances."
            .to_owned();
    }
    sentences(&list)
}

/// Every item in words.
fn words<T>(items: &[T], word: impl Fn(&T) -> String) -> Vec<String> {
    items.iter().map(word).collect()
}

/// Sentences from words without capital and full stop.
fn sentences(list: &[String]) -> String {
    list.iter().map(|words| format!("{}.", capital(words.trim_end_matches('.')))).collect::<Vec<_>>().join(" ")
}
