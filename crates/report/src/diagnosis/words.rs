//! The account of a diagnosis as questions and answers.

use depthcal_io::{DiagnosisCandidate, DiagnosisStep, GainInterval, Verdict};

use super::{ReportDiagnosis, last};
use crate::ReportInput;
use crate::checks::Level;
use crate::headline::interval;
use crate::html::{count, fixed, number};
use crate::leftover::join;
use crate::parameters::{free_function, summary};
use crate::statistics::{Estimate, quantile};

/// Free functions that are worth words take at least this much off the weighted residual, per cent.
const WORTH_PERCENT: f64 = 0.5;
/// Sentences on what to capture next that the first screen has room for.
const NEXT: usize = 3;

/// A question that a reader has, and its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    pub question: &'static str,
    pub answer: String,
    /// Section that tells more.
    pub more: &'static str,
}

/// `K, lens and D`, or the declared model's name.
pub(crate) fn declared_model(d: &ReportDiagnosis<'_>) -> String {
    match d.account.model.as_str() {
        "projective" => "K, lens and D".to_owned(),
        "none" => "K and lens without a depth model".to_owned(),
        other => format!("the declared model ({other})"),
    }
}

fn with_interval(e: &Estimate, unit: &str) -> String {
    match interval(e, unit) {
        Some(i) => format!("{} {unit} ({i})", number(e.value)),
        None => format!("{} {unit}", number(e.value)),
    }
}

/// The headline.
pub(crate) fn sentence(input: &ReportInput<'_>, d: &ReportDiagnosis<'_>) -> String {
    let Some(change) = last(input).depth_rms() else { return "No frame with depth could be judged.".to_owned() };
    let declared = d.declared().depth_rms().map_or(f64::NAN, |c| c.after.value);
    let frames = count(change.frames, "frame");
    let sure = interval(&change.after, "mm").map_or(format!("over {frames}"), |i| format!("{i} over {frames}"));
    let model = declared_model(d);
    let added: Vec<String> = d.added().iter().map(|n| (*n).to_owned()).collect();
    let (raw, now) = (number(change.before.value), number(change.after.value));
    match (d.account.verdict, added.is_empty()) {
        (Verdict::Adequate, _) => format!(
            "Depth was {raw} mm rms off. {model} leave {now} mm on frames that the fit did not see ({sure}), and these \
             captures show nothing that is missing.",
        ),
        (_, true) => format!(
            "Depth was {raw} mm rms off. {model} leave {now} mm on frames that the fit did not see ({sure}): something is \
             left that no known effect explains."
        ),
        (_, false) => format!(
            "Depth was {raw} mm rms off. {model} leave {} mm; with {} it is {now} mm ({sure}).",
            number(declared),
            join(&added)
        ),
    }
}

/// The verdict in a few words.
pub(crate) fn pill(d: &ReportDiagnosis<'_>) -> (Level, String) {
    let frames = d.account.bad_frames.len();
    let declarations = d.account.declarations.len();
    let (level, text) = match d.account.verdict {
        Verdict::Adequate => (Level::Good, "Adequate: nothing is missing that these captures can show"),
        Verdict::Effect => (Level::Good, "Effect: what was missing is found and added, and nothing else is left"),
        Verdict::Unexplained => (Level::Care, "Unexplained: something is left that no known effect describes"),
    };
    if declarations > 0 {
        return (Level::Bad, "Check the declarations: board size or depth unit cannot be right".to_owned());
    }
    let out = if frames > 0 { format!(" · {} left out", count(frames, "frame")) } else { String::new() };
    (level, format!("{text}{out}"))
}

/// All questions with their answers; `coverage` says what boards did not reach.
pub(crate) fn answers(input: &ReportInput<'_>, d: &ReportDiagnosis<'_>, coverage: &[String]) -> Vec<Answer> {
    let new = |question, answer: String, more| Answer { question, answer, more };
    let mut list = Vec::new();
    if !d.account.declarations.is_empty() {
        list.push(new("Are the declarations right?", sentences(&d.account.declarations), "next"));
    }
    list.push(new("How wrong was the depth?", how_wrong(input), "datasets"));
    list.push(new("Where?", place(input, d), "where"));
    list.push(new("Why?", why(d), "candidates"));
    list.push(new("What was added?", added(d), "steps"));
    list.push(new("How wrong is it now?", now(input, d), "where"));
    list.push(new("How sure is that?", sure(input, d), "trust"));
    list.push(new("What to capture next?", next(d, coverage), "next"));
    list
}

fn how_wrong(input: &ReportInput<'_>) -> String {
    let pool = last(input);
    let Some(depth) = pool.depth_rms() else { return "No depth could be judged.".to_owned() };
    let mut text = format!("By {} rms as measured, over all board pixels", with_interval(&depth.before, "mm"));
    if let Some(plane) = pool.plane_error() {
        text += &format!("; {} mm mean height over the board", number(plane.before.value));
    }
    text + "."
}

fn place(input: &ReportInput<'_>, d: &ReportDiagnosis<'_>) -> String {
    let pool = last(input);
    let at = |q: f64| quantile(pool.pixels().map(|p| p.before_mm), q);
    let (low, high) = (at(0.05), at(0.95));
    let side = match (low > 0.0, high < 0.0) {
        (true, _) => "nearly everywhere too far",
        (_, true) => "nearly everywhere too near",
        _ => "both too near and too far",
    };
    let mut text = format!("As measured {side}: {} to {} mm (5 % to 95 % of the pixels).", number(low), number(high));
    let Some(round) = d.account.rounds.first() else { return text };
    let mut seen: Vec<&str> = Vec::new();
    let mut words: Vec<String> = Vec::new();
    for free in round.free.iter().filter(|f| f.held_out_gain_percent > WORTH_PERCENT) {
        let name = free_function(&free.effect).trim_end_matches(" (in depth)");
        if !seen.contains(&name) && seen.len() < 3 {
            seen.push(name);
            words.push(format!("{name} ({} %)", number(free.held_out_gain_percent)));
        }
    }
    text += &if words.is_empty() {
        " What the declared model leaves follows no known quantity.".to_owned()
    } else {
        format!(
            " What the declared model leaves follows {}: share of the residual that a free function of it takes off \
             left-out frames.",
            join(&words)
        )
    };
    text
}

fn why(d: &ReportDiagnosis<'_>) -> String {
    let mut parts: Vec<String> = d
        .account
        .steps
        .iter()
        .filter_map(|s| Some(format!("{}: {}", s.effects.first()?, summary(d.register, s.effects.first()?))))
        .collect();
    if parts.is_empty() {
        parts.push(match d.account.verdict {
            Verdict::Adequate => "The declared model describes it; no effect of the catalogue is missing".to_owned(),
            _ => "Unknown: no effect of the catalogue explains what the declared model leaves".to_owned(),
        });
    } else if d.account.verdict == Verdict::Unexplained {
        parts.push("and something that no effect of the catalogue explains".to_owned());
    }
    let rivals: Vec<String> = d
        .account
        .steps
        .iter()
        .filter(|s| !s.indistinguishable.is_empty())
        .map(|s| format!(" These captures cannot tell {} from {}.", s.effects[0], join(&s.indistinguishable)))
        .collect();
    format!("{}.{}", parts.join("; "), rivals.concat())
}

/// `−16.5 % (13.5 to 20.1)`.
pub(crate) fn gain(g: &GainInterval) -> String {
    let way = if g.value >= 0.0 { "less" } else { "more" };
    let unsure = if g.is_certain() { "" } else { ", not certain" };
    format!("{} % {way} (95 % interval {} to {} %{unsure})", fixed(g.value.abs(), 1), fixed(g.low, 1), fixed(g.high, 1))
}

/// `6.60 → 5.51 mm`.
pub(crate) fn arrow(before: Option<f64>, after: Option<f64>, unit: &str) -> String {
    let show = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| fixed(v, if unit == "px" { 3 } else { 2 }));
    format!("{} → {} {unit}", show(before), show(after))
}

fn step_words(step: &DiagnosisStep) -> String {
    let change = arrow(step.before.depth_rms_mm, step.after.depth_rms_mm, "mm");
    let size = if step.size_mm > 0.0 { format!(" of {} mm rms", number(step.size_mm)) } else { String::new() };
    let gain = step.depth_gain_percent.as_ref().map_or(String::new(), |g| format!(", {}", gain(g)));
    format!("{}{size}: {change}{gain}.", step.effects.first().map_or("", String::as_str))
}

fn added(d: &ReportDiagnosis<'_>) -> String {
    if d.account.steps.is_empty() {
        let tested = d.account.rounds.first().map_or(0, |r| r.effects.len());
        return format!("Nothing; {} were tested.", count(tested, "effect"));
    }
    d.account.steps.iter().map(step_words).collect::<Vec<_>>().join(" ")
}

fn now(input: &ReportInput<'_>, d: &ReportDiagnosis<'_>) -> String {
    let pool = last(input);
    let Some(depth) = pool.depth_rms() else { return "No depth could be judged.".to_owned() };
    let dots = pool.dot_error().map_or(String::new(), |c| format!(", dots {} mm", number(c.after.value)));
    let mut text = format!("{} mm rms{dots}.", number(depth.after.value));
    if !d.account.left_over.is_empty() {
        text += &format!(" Left: {}", sentences(&d.account.left_over));
    }
    text
}

fn sure(input: &ReportInput<'_>, d: &ReportDiagnosis<'_>) -> String {
    let pool = last(input);
    let Some(depth) = pool.depth_rms() else { return "Not at all.".to_owned() };
    let sure = interval(&depth.after, "mm").unwrap_or_else(|| "too few frames for an interval".to_owned());
    let mut text =
        format!("{sure}, over {}, none of them seen by the fit that judges it.", count(depth.frames, "frame"));
    let unsure: Vec<String> = d
        .account
        .steps
        .iter()
        .filter(|s| s.depth_gain_percent.is_some_and(|g| !g.is_certain()))
        .filter_map(|s| s.effects.first().cloned())
        .collect();
    if !unsure.is_empty() {
        let (brings, its) =
            if unsure.len() == 1 { ("brings", "its interval holds") } else { ("bring", "their intervals hold") };
        text += &format!(" What {} {brings} may be chance: {its} zero.", join(&unsure));
    }
    if let Some(least) = smallest(d) {
        text += &format!(" {least}");
    }
    text
}

/// What a silent test means.
fn smallest(d: &ReportDiagnosis<'_>) -> Option<String> {
    let round = d.account.rounds.last()?;
    let seen = |c: &&DiagnosisCandidate| c.minimal_detectable_mm.is_some_and(|m| m > 0.0);
    let sizes: Vec<f64> = round.effects.iter().filter(seen).filter_map(|c| c.minimal_detectable_mm).collect();
    let blind = round.effects.len() - sizes.len();
    let of = |q: f64| number(quantile(sizes.iter().copied(), q));
    let blind = if blind == 0 { String::new() } else { format!("; {} cannot be seen at all", count(blind, "effect")) };
    (!sizes.is_empty()).then(|| {
        format!("Effects smaller than {} to {} mm, by their kind, would not have shown{blind}.", of(0.0), of(1.0))
    })
}

/// What to capture next: what tells rivals apart comes first, then what boards did not reach.
fn next(d: &ReportDiagnosis<'_>, coverage: &[String]) -> String {
    let list: Vec<String> = d.account.capture_next.iter().take(NEXT).chain(coverage).cloned().collect();
    if list.is_empty() {
        return "Nothing in particular: these captures tell the effects apart and cover image and range.".to_owned();
    }
    sentences(&list)
}

/// Sentences from the account, which begins them with small letters and leaves the full stop out.
fn sentences(list: &[String]) -> String {
    let one = |s: &String| {
        let mut chars = s.chars();
        // Names of effects keep their small letter.
        let name = s.split(':').next().is_some_and(|w| w.contains('_'));
        let first: String =
            chars.next().map_or(String::new(), |c| if name { c.to_string() } else { c.to_uppercase().collect() });
        format!("{first}{}.", chars.as_str().trim_end_matches('.'))
    };
    list.iter().map(one).collect::<Vec<_>>().join(" ")
}
