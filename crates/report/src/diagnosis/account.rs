//! The sections of a diagnosis: steps, candidates, what cannot be told apart, frames, what to capture next.

use std::fmt::Write;

use depthcal_io::{DiagnosisCandidate, DiagnosisRound, DiagnosisStep};

use super::ReportDiagnosis;
use super::words::{arrow, gain};
use crate::html::{count, escape, measured, number};
use crate::leftover::join;
use crate::parameters::{free_function, meaning, summary};

/// Cosine from which two effects are said to be hard to tell apart.
const ALIKE: f64 = 0.9;

fn p_value(p: f64) -> String {
    match p {
        p if p < 1e-16 => "&lt; 10⁻¹⁶".to_owned(),
        p if p < 1e-3 => format!("{p:.0e}"),
        p => format!("{p:.3}"),
    }
}

fn mm(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), number)
}

/// What was added, step by step.
pub(crate) fn steps(d: &ReportDiagnosis<'_>) -> String {
    let mut html = String::new();
    if d.account.steps.is_empty() {
        html += "<p>No effect was added.</p>\n";
    } else {
        let rows: String = d.account.steps.iter().enumerate().map(|(i, s)| step_row(d, i, s)).collect();
        let _ = writeln!(
            html,
            "<div class=\"scroll\" tabindex=\"0\"><table><caption>Every step, on frames that the fit did not see. Size: \
             rms over the observations of what the effect alone does; other parameters may take up a part of it.</caption>\
             <thead><tr><th scope=\"col\">added</th><th scope=\"col\">size / mm</th><th scope=\"col\">p</th>\
             <th scope=\"col\">depth, rms</th><th scope=\"col\" class=\"text\">change</th><th scope=\"col\">plane, \
             mean</th><th scope=\"col\">dot, mean</th><th scope=\"col\">reprojection</th></tr></thead><tbody>{rows}</tbody></table></div>"
        );
        html += &parameters(d);
    }
    html += &rounds(d);
    html
}

fn step_row(d: &ReportDiagnosis<'_>, i: usize, s: &DiagnosisStep) -> String {
    let name = s.effects.first().map_or("", String::as_str);
    let mut notes = vec![summary(d.register, name).to_owned()];
    if s.effects.len() > 1 {
        notes.push(format!("explains together with {}", join(&s.effects[1..])));
    }
    if !s.indistinguishable.is_empty() {
        notes.push(format!("cannot be told from {}", join(&s.indistinguishable)));
    }
    let (b, a) = (&s.before, &s.after);
    let gain = s.depth_gain_percent.as_ref().map_or_else(|| "–".to_owned(), gain);
    let class = match &s.depth_gain_percent {
        Some(g) if g.is_certain() => "good",
        Some(g) if g.high < 0.0 => "bad",
        _ => "care",
    };
    format!(
        "<tr><th scope=\"row\">{}. {} <span class=\"hint\">{}</span></th><td>{}</td><td>{}</td><td>{}</td>\
         <td class=\"text {class}\">{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        i + 1,
        escape(name),
        escape(&notes.join("; ")),
        number(s.size_mm),
        p_value(s.p_value),
        arrow(b.depth_rms_mm, a.depth_rms_mm, "mm"),
        escape(&gain),
        arrow(b.plane_error_mm, a.plane_error_mm, "mm"),
        arrow(b.dot_error_mm, a.dot_error_mm, "mm"),
        arrow(Some(b.reprojection_px), Some(a.reprojection_px), "px"),
    )
}

fn parameters(d: &ReportDiagnosis<'_>) -> String {
    let mut rows = String::new();
    for step in d.account.steps.iter().filter(|s| !s.parameters.is_empty()) {
        let name = step.effects.first().map_or("", String::as_str);
        let _ = writeln!(
            rows,
            "<tr class=\"piece\"><th colspan=\"3\" scope=\"rowgroup\"><code>--with {}</code></th></tr>",
            escape(&step.with)
        );
        for p in &step.parameters {
            let unit = if p.unit == "1" { "" } else { p.unit.as_str() };
            let _ = writeln!(
                rows,
                "<tr><th scope=\"row\"><code>{}</code></th><td>{} {}</td><td class=\"text\">{}</td></tr>",
                escape(&p.name),
                measured(p.value, p.std),
                escape(unit),
                escape(meaning(d.register, name, &p.name).unwrap_or("–"))
            );
        }
    }
    if rows.is_empty() {
        return rows;
    }
    format!(
        "<details><summary>Parameters of what was added</summary><div class=\"scroll\" tabindex=\"0\"><table \
         class=\"parameters\"><thead><tr><th scope=\"col\">name</th><th scope=\"col\">value ± one standard deviation</th>\
         <th scope=\"col\" class=\"text\">meaning</th></tr></thead><tbody>{rows}</tbody></table></div></details>\n"
    )
}

/// What every round found and decided.
fn rounds(d: &ReportDiagnosis<'_>) -> String {
    let items: String = d
        .account
        .rounds
        .iter()
        .map(|r| {
            format!(
                "<li>{} and {} were tested: {}.</li>\n",
                count(r.effects.len(), "effect"),
                count(r.free.len(), "free function"),
                escape(&r.decision)
            )
        })
        .collect();
    if items.is_empty() {
        return items;
    }
    format!("<details><summary>What every round tested and decided</summary><ol>{items}</ol></details>\n")
}

/// Candidates of the first and the last round as a table.
pub(crate) fn candidates(d: &ReportDiagnosis<'_>) -> String {
    let table = |title: &str, r: &DiagnosisRound| {
        let row = |c: &DiagnosisCandidate, free: bool| {
            let name = if free { format!("free function of {}", free_function(&c.effect)) } else { c.effect.clone() };
            let hint = if free {
                String::new()
            } else {
                format!(" <span class=\"hint\">{}</span>", escape(summary(d.register, &c.effect)))
            };
            let blind = !free && c.minimal_detectable_mm.is_none_or(|m| m <= 0.0);
            let detectable = if blind { "not seen".to_owned() } else { mm(c.minimal_detectable_mm) };
            format!(
                "<tr><th scope=\"row\">{}{hint}</th><td>{} %</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escape(&name),
                number(c.held_out_gain_percent),
                mm(c.expected_size_mm),
                if free { "–".to_owned() } else { detectable },
                p_value(c.p_value)
            )
        };
        let rows: String = r.effects.iter().map(|c| row(c, false)).chain(r.free.iter().map(|c| row(c, true))).collect();
        format!(
            "<details><summary>{title}: all numbers</summary><div class=\"scroll\" tabindex=\"0\"><table><caption>Gain: \
             fall of the weighted residual on frames left out of the estimate. Size: rms that the data would give it. \
             Detectable: the size that is found in four of five such captures. p: of the score test, which says whether, \
             not how much.</caption><thead><tr><th scope=\"col\">candidate</th><th scope=\"col\">gain</th><th \
             scope=\"col\">size / mm</th><th scope=\"col\">detectable / mm</th><th scope=\"col\">p</th></tr></thead>\
             <tbody>{rows}</tbody></table></div></details>\n"
        )
    };
    let rounds = &d.account.rounds;
    let mut html = rounds.first().map_or(String::new(), |r| table("Beside the declared model", r));
    if rounds.len() > 1 {
        html += &rounds.last().map_or(String::new(), |r| table("Beside the last model", r));
    }
    html
}

/// What these captures cannot tell apart, in sentences.
pub(crate) fn apart(d: &ReportDiagnosis<'_>) -> String {
    let Some(s) = &d.account.separability else { return String::new() };
    let added = d.added();
    let mut words = Vec::new();
    for (i, effect) in s.effects.iter().enumerate() {
        let mut rivals: Vec<(f64, &String)> =
            s.effects.iter().enumerate().filter(|(k, _)| *k != i).map(|(k, n)| (s.mimicry[i][k], n)).collect();
        rivals.sort_by(|a, b| b.0.total_cmp(&a.0));
        let like: Vec<String> =
            rivals.iter().filter(|r| r.0 >= ALIKE).map(|r| format!("{} ({:.2})", r.1, r.0)).collect();
        let own = added.contains(&effect.as_str());
        match (own, like.is_empty(), rivals.first()) {
            (_, false, _) => words.push(format!("{} can pass for {effect}.", join(&like))),
            (true, true, Some((cosine, rival))) => {
                words.push(format!(
                    "{effect}, which was added, is told apart from all others; the nearest is {rival} ({cosine:.2})."
                ));
            }
            _ => {}
        }
    }
    // What was added comes first.
    words.sort_by_key(|w| !added.iter().any(|a| w.starts_with(*a)));
    let items: String = words.iter().map(|w| format!("<li>{}</li>\n", escape(w))).collect();
    if items.is_empty() {
        return format!(
            "<p>Every effect that these captures see is told apart from every other (cosines below {ALIKE}).</p>\n"
        );
    }
    format!("<ul>{items}</ul>\n")
}

/// Frames that were left out, and why.
pub(crate) fn frames(d: &ReportDiagnosis<'_>) -> String {
    if d.account.bad_frames.is_empty() {
        return "<p>No frame was left out: none is a copy of another, and none has depth that does not belong to its \
                image.</p>\n"
            .to_owned();
    }
    let rows: String = d
        .account
        .bad_frames
        .iter()
        .map(|f| {
            format!(
                "<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td></tr>\n",
                escape(&f.name),
                escape(&f.reason)
            )
        })
        .collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table><caption>{} left out of every fit</caption><thead><tr><th \
         scope=\"col\">frame</th><th scope=\"col\" class=\"text\">why</th></tr></thead><tbody>{rows}</tbody></table></div>\n",
        count(d.account.bad_frames.len(), "frame")
    )
}

/// What to capture next, and what to check.
pub(crate) fn next(d: &ReportDiagnosis<'_>, coverage: &[String]) -> String {
    let list = |items: &[String]| -> String { items.iter().map(|s| format!("<li>{}</li>\n", escape(s))).collect() };
    let mut html = String::new();
    if !d.account.declarations.is_empty() {
        let _ = writeln!(html, "<p>Check the declarations first:</p><ul>{}</ul>", list(&d.account.declarations));
    }
    let mut items = d.account.capture_next.clone();
    items.extend(coverage.iter().cloned());
    if items.is_empty() {
        html += "<p>Nothing in particular: these captures tell the effects apart and cover the image.</p>\n";
    } else {
        let _ = writeln!(html, "<ul>{}</ul>", list(&items));
    }
    html
}
