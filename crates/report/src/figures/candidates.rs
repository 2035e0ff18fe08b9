//! The tested candidates: their gains on held-out frames, their sizes against detectable ones, and their separability.

use depthcal_io::{DiagnosisCandidate, DiagnosisRound};
use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{AFTER, NEUTRAL, OTHER, colour_bar, plain, rounded, sequential, short};
use crate::diagnosis::sentences::decision;
use crate::format::{capital, count, percent};
use crate::input::ReportDiagnosis;

/// Negative bars are cut off at this share of the longest positive one: a loss may be arbitrarily large.
const MOST_HARM: f64 = 0.25;
/// Significance level of a score test, before the correction for the number of tests.
const LEVEL: f64 = 0.01;

fn name(c: &DiagnosisCandidate, free: bool) -> String {
    if free { format!("<i>{}</i>", plain(&c.effect)) } else { plain(&c.effect) }
}

/// Candidates of a round by falling gain, effects and free functions together.
fn ranked(round: &DiagnosisRound) -> Vec<(&DiagnosisCandidate, bool)> {
    let mut list: Vec<_> =
        round.effects.iter().map(|c| (c, false)).chain(round.free.iter().map(|c| (c, true))).collect();
    list.sort_by(|a, b| b.0.held_out_gain_percent.total_cmp(&a.0.held_out_gain_percent));
    list
}

fn round_name(i: usize, d: &ReportDiagnosis<'_>) -> String {
    if i == 0 { format!("1: given {}", d.register.model_words(&d.record.model)) } else { format!("{}", i + 1) }
}

/// Gains on held-out frames, one round at a time; `None` without rounds.
pub(crate) fn ranking(d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let rounds = &d.record.rounds;
    let first = rounds.first().filter(|r| !r.effects.is_empty())?;
    let most = rounds.iter().flat_map(ranked).map(|c| c.0.held_out_gain_percent).fold(0.1, f64::max);
    let least = -MOST_HARM * most;
    let trace = |round: &DiagnosisRound| {
        let list = ranked(round);
        let significant = |c: &DiagnosisCandidate| {
            c.p_value * (round.effects.len().max(1) as f64) < LEVEL && c.held_out_gain_percent > 0.0
        };
        let colour = |(c, free): &(&DiagnosisCandidate, bool)| match (*free, significant(c)) {
            (true, _) => OTHER,
            (false, true) => AFTER,
            (false, false) => NEUTRAL,
        };
        json!({
            "y": list.iter().map(|c| name(c.0, c.1)).collect::<Value>(),
            "x": list.iter().map(|c| short(c.0.held_out_gain_percent.max(least))).collect::<Value>(),
            "text": list.iter().map(|c| percent(c.0.held_out_gain_percent)).collect::<Value>(),
            // There is no room next to a bar that is cut off.
            "textposition": list.iter().map(|c| if c.0.held_out_gain_percent < least { "inside" } else { "outside" }).collect::<Value>(),
            "marker": {"color": list.iter().map(colour).collect::<Value>()},
        })
    };
    let mut data = trace(first);
    data["type"] = json!("bar");
    data["orientation"] = json!("h");
    data["insidetextanchor"] = json!("start");
    data["cliponaxis"] = json!(false);
    data["hovertemplate"] = json!("%{y}: %{text}<extra></extra>");
    let layout = json!({
        "yaxis": {"type": "category", "autorange": "reversed", "tickfont": {"size": 11}, "dtick": 1}, "showlegend": false,
        "xaxis": {"title": {"text": "gain on held-out frames / %"}, "range": [1.3 * least, 1.2 * most], "zeroline": true},
    });
    let best: Vec<String> = ranked(first)
        .iter()
        .take(3)
        .map(|c| format!("{} {}", name(c.0, c.1), percent(c.0.held_out_gain_percent)))
        .collect();
    let mut figure = Figure::new("candidates-gain", "Candidates by their gain on held-out frames", vec![data], layout)
        .caption(
            "Decrease of the weighted residual of held-out frames when the candidate is added, from one linearisation. Blue: \
             significant effects; grey: other effects; violet, slanted: free functions of one quantity, which compete with \
             the effects but name no cause. Long negative bars are cut off.",
        )
        .alt(format!("Ranking of the candidates. First round: {}.", best.join(", ").replace("<i>", "").replace("</i>", "")))
        .aspect(0.95);
    figure.variants = rounds
        .iter()
        .enumerate()
        .map(|(i, r)| Variant {
            label: round_name(i, d),
            note: format!("{}.", capital(&decision(&r.decision, d.register))),
            trace: trace(r),
        })
        .collect();
    Some(figure)
}

/// Estimated size of each effect and the smallest detectable one, given the last model; `None` without detectable effects.
pub(crate) fn sizes(d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let round = d.record.rounds.last()?;
    let seen: Vec<(&DiagnosisCandidate, f64)> = round
        .effects
        .iter()
        .filter_map(|c| Some((c, c.minimal_detectable_mm.filter(|m| *m > 0.0 && m.is_finite())?)))
        .collect();
    if seen.is_empty() {
        return None;
    }
    let blind: Vec<&str> = round
        .effects
        .iter()
        .filter(|c| c.minimal_detectable_mm.is_none_or(|m| m <= 0.0))
        .map(|c| c.effect.as_str())
        .collect();
    let names: Value = seen.iter().map(|c| plain(&c.0.effect)).collect();
    let bars = json!({
        "type": "bar", "orientation": "h", "name": "not detectable", "y": names,
        "x": seen.iter().map(|c| short(c.1)).collect::<Value>(), "marker": {"color": NEUTRAL, "opacity": 0.45},
        "hovertemplate": "%{y}: %{x:.3~g} mm<extra>detectable</extra>",
    });
    let points = json!({
        "type": "scatter", "mode": "markers", "name": "estimated size", "y": names,
        "x": seen.iter().map(|c| c.0.expected_size_mm.map_or(Value::Null, short)).collect::<Value>(),
        "marker": {"color": AFTER, "size": 9, "symbol": "diamond"},
        "hovertemplate": "%{y}: %{x:.3~g} mm<extra>estimated</extra>",
    });
    let low = seen
        .iter()
        .flat_map(|c| [Some(c.1), c.0.expected_size_mm.filter(|s| *s > 0.0)])
        .flatten()
        .fold(f64::INFINITY, f64::min);
    let high = seen.iter().flat_map(|c| [Some(c.1), c.0.expected_size_mm]).flatten().fold(0.0, f64::max);
    let layout = json!({
        "yaxis": {"type": "category", "autorange": "reversed", "tickfont": {"size": 11}, "dtick": 1},
        "xaxis": {"title": {"text": "size, rms / mm"}, "type": "log", "range": [(low / 1.6).log10(), (high * 1.6).log10()]},
    });
    let undetectable = if blind.is_empty() {
        String::new()
    } else {
        format!(" Not detectable at any size: {}.", plain(&blind.join(", ")))
    };
    Some(
        Figure::new("candidates-size", "Which sizes would have been detected, given the last model", vec![bars, points], layout)
            .caption(format!(
                "A bar ends at the smallest size that is found in four of five such captures (level 1 %, corrected for the number \
                 of effects). A diamond inside its bar is within noise; one outside is significant, which by itself does \
                 not make the effect the cause.{undetectable}"
            ))
            .alt(format!("Detectable sizes of {}.", count(seen.len(), "effect")))
            .aspect(0.95),
    )
}

/// Which effects can be mistaken for each other; `None` where the record has no matrix.
pub(crate) fn separability(d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let s = d.record.separability.as_ref().filter(|s| s.effects.len() > 1)?;
    let names: Value = s.effects.iter().map(|n| plain(n)).collect();
    let z: Value = s.mimicry.iter().map(|r| r.iter().map(|c| rounded(*c, 2)).collect::<Value>()).collect();
    let data = json!({
        "type": "heatmap", "x": names, "y": names, "z": z, "zmin": 0, "zmax": 1, "colorscale": sequential(),
        "reversescale": true, "colorbar": colour_bar("cos"),
        "hovertemplate": "%{y} can be mistaken for %{x}: %{z}<extra></extra>",
    });
    let layout = json!({
        "xaxis": {"type": "category", "tickangle": -50, "showgrid": false, "tickfont": {"size": 11}, "dtick": 1},
        "yaxis": {"type": "category", "autorange": "reversed", "showgrid": false, "tickfont": {"size": 11}, "dtick": 1},
    });
    Some(
        Figure::new("separability", "Which effects can be mistaken for each other", vec![data], layout)
            .caption(
                "Row: the effect that is present, at its estimated parameters and without what the declared model compensates. \
                 Column: the effect that it could be mistaken for. Cosine of the angle between the two: 1, \
                 indistinguishable on these captures; 0, nothing in common. Captures at other distances, tilts and places \
                 in the image lower it.",
            )
            .alt("Matrix of how similar the effects are on these captures.")
            .aspect(1.2),
    )
}
