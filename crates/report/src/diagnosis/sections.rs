//! The sections of a diagnosis: steps, candidates, separability, excluded frames, what to capture next.

use std::fmt::Write;

use depthcal_io::{DiagnosisCandidate, DiagnosisRound, DiagnosisStep};

use super::answers::{arrow, gain};
use super::formula::formulas;
use super::sentences::{
    capture, covariate, decision, declaration, frame_cause, place, refuted, rivals_of_other_technologies,
};
use super::text::spline_words;
use crate::format::{count, join, measured, number, p_value, percent, shown_unit};
use crate::html::escape;
use crate::input::ReportDiagnosis;
use crate::left_out::share;
use crate::parameters::{meaning, summary};

/// Cosine from which two effects count as hard to separate.
const ALIKE: f64 = 0.9;

fn mm(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), number)
}

/// The added effects, step by step, and what each round decided.
pub(crate) fn steps(d: &ReportDiagnosis<'_>) -> String {
    let mut html = String::new();
    if d.record.steps.is_empty() {
        html += "<p>No effect was added.</p>\n";
    } else {
        let rows: String = d.record.steps.iter().enumerate().map(|(i, s)| step_row(d, i, s)).collect();
        let _ = writeln!(
            html,
            "<div class=\"scroll\" tabindex=\"0\"><table><caption>Errors before → after every step, on held-out frames. Size: \
             rms over the observations of what other parameters of the model do not compensate.</caption>\
             <thead><tr><th scope=\"col\">added</th><th scope=\"col\">size / mm</th><th scope=\"col\">p</th>\
             <th scope=\"col\">depth error, rms</th><th scope=\"col\" class=\"text\">gain, given all others</th><th scope=\"col\">left \
             out</th><th scope=\"col\">plane error, mean</th><th scope=\"col\">dot error, mean</th><th scope=\"col\">reprojection error, rms</th></tr>\
             </thead><tbody>{rows}</tbody></table></div>"
        );
        html += &formulas(d.record);
        html += &parameters(d);
    }
    html += &rounds(d);
    html
}

fn step_row(d: &ReportDiagnosis<'_>, i: usize, s: &DiagnosisStep) -> String {
    let name = s.effects.first().map_or("", String::as_str);
    let mut notes = vec![summary(d.register, name).to_owned()];
    notes.extend(place(s));
    if s.effects.len() > 1 {
        notes.push(format!("found together with {}", join(&s.effects[1..])));
    }
    if !s.indistinguishable.is_empty() {
        notes.push(format!("not distinguishable from {}", join(&s.indistinguishable)));
    }
    notes.extend(rivals_of_other_technologies(s));
    let (b, a) = (&s.before, &s.after);
    let gain = s.gain().as_ref().map_or_else(|| "–".to_owned(), gain);
    let class = match s.gain() {
        Some(g) if g.is_certain() => "good",
        Some(g) if g.high < 0.0 => "bad",
        _ => "care",
    };
    format!(
        "<tr><th scope=\"row\">{}. {} <span class=\"hint\">{}</span></th><td>{}</td><td>{}</td><td>{}</td>\
         <td class=\"text {class}\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        i + 1,
        escape(name),
        escape(&notes.join("; ")),
        number(s.size_mm),
        escape(&p_value(s.p_value)),
        arrow(b.depth_rms_mm, a.depth_rms_mm, "mm"),
        escape(&gain),
        escape(&share(a.outliers.map(|o| o.share))),
        arrow(b.plane_error_mm, a.plane_error_mm, "mm"),
        arrow(b.dot_error_mm, a.dot_error_mm, "mm"),
        arrow(b.reprojection_px, a.reprojection_px, "px"),
    )
}

fn parameters(d: &ReportDiagnosis<'_>) -> String {
    let mut rows = String::new();
    for step in d.record.steps.iter().filter(|s| !s.parameters.is_empty()) {
        let name = step.effects.first().map_or("", String::as_str);
        let _ = writeln!(
            rows,
            "<tr class=\"piece\"><th colspan=\"3\" scope=\"rowgroup\"><code>{}</code></th></tr>",
            escape(&d.register.words(&step.with))
        );
        let (parameters, splines) = step.parameters_and_splines();
        for spline in &splines {
            let _ = writeln!(rows, "<tr><td colspan=\"3\" class=\"text\">{}</td></tr>", escape(&spline_words(spline)));
        }
        for p in parameters {
            let unit = shown_unit(&p.unit);
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
        "<details><summary>Parameters of the added effects</summary><div class=\"scroll\" tabindex=\"0\"><table \
         class=\"parameters\"><thead><tr><th scope=\"col\">name</th><th scope=\"col\">value ± one standard deviation</th>\
         <th scope=\"col\" class=\"text\">meaning</th></tr></thead><tbody>{rows}</tbody></table></div></details>\n"
    )
}

/// Tests and decision of each round.
fn rounds(d: &ReportDiagnosis<'_>) -> String {
    let items: String = d
        .record
        .rounds
        .iter()
        .map(|r| {
            let sentences = std::iter::once(decision(&r.decision, d.register)).chain(r.refuted.iter().map(refuted));
            format!(
                "<li>Of {} and {}: {}.</li>\n",
                count(r.effects.len(), "effect"),
                count(r.free.len(), "free function"),
                escape(&sentences.collect::<Vec<_>>().join("; "))
            )
        })
        .collect();
    if items.is_empty() {
        return items;
    }
    format!("<details><summary>What each round tested and decided</summary><ol>{items}</ol></details>\n")
}

/// Candidates of the first and the last round as a table.
pub(crate) fn candidates(d: &ReportDiagnosis<'_>) -> String {
    let table = |title: &str, r: &DiagnosisRound| {
        let row = |c: &DiagnosisCandidate, free: bool| {
            let name =
                c.along.map_or_else(|| c.effect.clone(), |along| format!("free function of {}", covariate(along)));
            let hint = if free { &c.effect } else { summary(d.register, &c.effect) };
            let hint = format!(" <span class=\"hint\">{}</span>", escape(hint));
            let blind = !free && c.minimal_detectable_mm.is_none_or(|m| m <= 0.0);
            let detectable = if blind { "not testable".to_owned() } else { mm(c.minimal_detectable_mm) };
            format!(
                "<tr><th scope=\"row\">{}{hint}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escape(&name),
                percent(c.held_out_gain_percent),
                mm(c.expected_size_mm),
                if free { "–".to_owned() } else { detectable },
                escape(&p_value(c.p_value))
            )
        };
        let rows: String = r.effects.iter().map(|c| row(c, false)).chain(r.free.iter().map(|c| row(c, true))).collect();
        format!(
            "<details><summary>{title}: all numbers</summary><div class=\"scroll\" tabindex=\"0\"><table><caption>Gain: \
             decrease of the weighted residual on held-out frames. Size: rms of the effect as estimated from these \
             captures, less what fitted parameters compensate. Detectable: the size that is found in four of five such captures. p: significance of the score \
             test, which says nothing about the size.</caption><thead><tr><th scope=\"col\">candidate</th><th scope=\"col\">gain</th><th \
             scope=\"col\">size / mm</th><th scope=\"col\">detectable / mm</th><th scope=\"col\">p</th></tr></thead>\
             <tbody>{rows}</tbody></table></div></details>\n"
        )
    };
    let rounds = &d.record.rounds;
    let mut html = rounds.first().map_or(String::new(), |r| table("Given the declared model", r));
    if rounds.len() > 1 {
        html += &rounds.last().map_or(String::new(), |r| table("Given the last model", r));
    }
    html
}

/// Effects that these captures cannot separate, in sentences.
pub(crate) fn apart(d: &ReportDiagnosis<'_>) -> String {
    let Some(s) = &d.record.separability else { return String::new() };
    let added = d.added();
    // Added effects come first.
    let (mut of_added, mut of_others) = (Vec::new(), Vec::new());
    for (i, effect) in s.effects.iter().enumerate() {
        let mut rivals: Vec<(f64, &String)> =
            s.effects.iter().enumerate().filter(|(k, _)| *k != i).map(|(k, n)| (s.mimicry[i][k], n)).collect();
        rivals.sort_by(|a, b| b.0.total_cmp(&a.0));
        let like: Vec<String> =
            rivals.iter().filter(|r| r.0 >= ALIKE).map(|r| format!("{} ({:.2})", r.1, r.0)).collect();
        let is_added = added.contains(&effect.as_str());
        let words = if is_added { &mut of_added } else { &mut of_others };
        match (is_added, like.is_empty(), rivals.first()) {
            (_, false, _) => words.push(format!("{effect} can be mistaken for {}.", join(&like))),
            (true, true, Some((cosine, rival))) => {
                words.push(format!(
                    "{effect}, which was added, is separable from all others; the closest is {rival} ({cosine:.2})."
                ));
            }
            _ => {}
        }
    }
    let items: String = of_added.iter().chain(&of_others).map(|w| format!("<li>{}</li>\n", escape(w))).collect();
    if items.is_empty() {
        return format!(
            "<p>All effects that these captures show are separable from each other (cosines below {ALIKE}).</p>\n"
        );
    }
    format!("<ul>{items}</ul>\n")
}

/// Frames that were excluded, and why.
pub(crate) fn frames(d: &ReportDiagnosis<'_>) -> String {
    if d.record.bad_frames.is_empty() {
        return "<p>No frame was excluded: none is a copy of another, and the depth of each belongs to its image.</p>\n"
            .to_owned();
    }
    let rows: String = d
        .record
        .bad_frames
        .iter()
        .map(|f| {
            format!(
                "<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td></tr>\n",
                escape(&f.name),
                escape(&frame_cause(&f.cause))
            )
        })
        .collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table><caption>{} excluded from every fit</caption><thead><tr><th \
         scope=\"col\">frame</th><th scope=\"col\" class=\"text\">reason</th></tr></thead><tbody>{rows}</tbody></table></div>\n",
        count(d.record.bad_frames.len(), "frame")
    )
}

/// Captures to make next, and declarations to check.
pub(crate) fn next(d: &ReportDiagnosis<'_>, coverage: &[String]) -> String {
    let list = |items: &[String]| -> String { items.iter().map(|s| format!("<li>{}</li>\n", escape(s))).collect() };
    let mut html = String::new();
    if !d.record.declarations.is_empty() {
        let _ = writeln!(
            html,
            "<p>Check the dataset file first:</p><ul>{}</ul>",
            list(&d.record.declarations.iter().map(declaration).collect::<Vec<_>>())
        );
    }
    let mut items: Vec<String> = d.record.capture_next.iter().map(capture).collect();
    items.extend(coverage.iter().cloned());
    if items.is_empty() {
        html += "<p>Nothing in particular: these captures separate the effects and cover the image and the distances.</p>\n";
    } else {
        let _ = writeln!(html, "<ul>{}</ul>", list(&items));
    }
    html
}
