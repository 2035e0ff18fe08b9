//! The report of a comparison of depth models.

use std::fmt::Write;

use depthcal_io::{Comparison, Interval};

use super::content::Content;
use super::format::{fixed, interval, number, percent};
use super::html::escape;
use super::input::{Made, ReportError};
use super::left_out::share;
use super::made::made;
use super::{figures, page};
use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::compare::tables::Table;
use depthcal_model::Register;

/// Renders a comparison as one self-contained HTML file. `tables` are the comparison's tables, the ranking first;
/// `best` is the best model fitted to all training frames, whose correction is shown as maps; `register` has the
/// pieces of the models.
///
/// # Errors
///
/// [`ReportError::Nothing`] where no model was compared.
pub(super) fn render_comparison(
    c: &Comparison,
    tables: &[Table],
    best: Option<&CalibratedCamera>,
    register: &Register,
    how: &Made,
) -> Result<String, ReportError> {
    if c.models.is_empty() {
        return Err(ReportError::Nothing);
    }
    let mut content = Content::default();
    first_screen(&mut content, c, register);
    ranked(&mut content, c, register);
    if !c.learning_curve.is_empty() {
        let intro = "Fits to some of the frames, evaluated on the others or on the other datasets. Where a line is level, \
                     more captures of this kind do not help.";
        content.open("learning", ["Learning curve", "How many captures does a model need?"], intro);
        content.grid(&[figures::learning_curve(c, register)], "one");
        content.close();
    }
    let maps = best.map(figures::correction_maps).unwrap_or_default();
    if !maps.is_empty() {
        content.open("map", ["Best model", "The correction by the best model"], "");
        content.picker("map-picker", "Distance", &maps, 1);
        content.grid(&maps, "two");
        content.close();
    }
    thesis(&mut content, c, tables);
    page::render(&format!("Depth models on {}", c.train), &made(how), &content)
}

fn first_screen(content: &mut Content, c: &Comparison, register: &Register) {
    let mut sentences = c.verdict.iter();
    let first = sentences.next().map_or("", String::as_str);
    let others: String = sentences.map(|s| format!("<p>{}</p>\n", escape(s))).collect();
    let evaluated = if c.verify.is_empty() {
        format!("Evaluated on held-out frames of {}.", escape(&c.train))
    } else {
        format!("Evaluated on {}.", escape(&c.verify.join(", ")))
    };
    content.open_verdict(&escape(first));
    let _ = writeln!(content.body, "<div class=\"story\">{others}<p>{evaluated}</p></div>");
    let list = [figures::model_ranking(c, register)];
    content.picker("error-picker", "Error", &list, 0);
    content.grid(&list, "one");
    content.close();
}

fn ranked(content: &mut Content, c: &Comparison, register: &Register) {
    let intro = "Errors on held-out data with 95 % intervals from resampled frames, best model first. Effective parameters: \
                 how many of the parameters the data determine, rather than the prior. AIC and BIC assume independent \
                 pixels, which they are not, and therefore favour models with many parameters.";
    content.open("models", ["All numbers", "All models"], intro);
    let show = |value: Option<Interval>| {
        value.map_or_else(
            || "<td>–</td>".to_owned(),
            |i| {
                format!(
                    "<td><b>{}</b> <span class=\"interval\">{}</span></td>",
                    number(i.mean),
                    interval(i.low, i.high, "")
                )
            },
        )
    };
    let mut rows = String::new();
    for m in &c.models {
        let name = escape(&register.model_words(&m.model));
        if let Some(reason) = &m.failed {
            let _ = writeln!(
                rows,
                "<tr><th scope=\"row\"><code>{name}</code></th><td colspan=\"8\" class=\"text bad\">no fit: {}</td></tr>",
                escape(reason)
            );
            continue;
        }
        let worse = if m.really_worse { "<span class=\"hint\">significantly worse</span>" } else { "" };
        let criterion = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| fixed(v, 0));
        let held = &m.held_out;
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\"><code>{name}</code>{worse}</th><td>{} <span class=\"interval\">of {}</span></td>\
             {}{}{}<td>{}</td>{}<td>{}</td><td>{}</td></tr>",
            fixed(m.effective_parameters, 1),
            m.parameters,
            show(held.dot_error_mm),
            show(held.plane_error_mm),
            show(held.depth_rms_mm),
            escape(&share(m.left_out_share())),
            show(m.worse_than_best_mm),
            criterion(m.aic),
            criterion(m.bic),
        );
    }
    let _ = writeln!(
        content.body,
        "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th scope=\"col\">model</th><th scope=\"col\">effective \
         parameters</th><th scope=\"col\">dot error / mm</th><th scope=\"col\">plane error / mm</th><th scope=\"col\">depth error, \
         rms / mm</th><th scope=\"col\">left out</th><th scope=\"col\">dot error minus that of the best / mm</th><th scope=\"col\">ΔAIC</th><th \
         scope=\"col\">ΔBIC</th></tr></thead><tbody>{rows}</tbody></table></div>"
    );
    let refused: Vec<String> = c
        .models
        .iter()
        .filter(|m| m.not_correctable > 0.0)
        .map(|m| format!("{} ({})", register.model_words(&m.model), percent(100.0 * m.not_correctable)))
        .collect();
    if !refused.is_empty() {
        let _ = writeln!(
            content.body,
            "<p class=\"note\">Pixels that a model cannot correct are excluded from its errors: {}.</p>",
            escape(&refused.join(", "))
        );
    }
    content.close();
}

/// The tables of Sjöholm 2017 and the stability of D.
fn thesis(content: &mut Content, c: &Comparison, tables: &[Table]) {
    // The first table is the ranking, and the learning curve is a figure.
    let of_thesis: Vec<&Table> = tables.iter().skip(1).collect();
    if of_thesis.is_empty() {
        return;
    }
    content.open("tables", ["Tables", "All tables"], "");
    if let Some(stability) = &c.stability {
        let items: String = stability.verdict.iter().map(|s| format!("<li>{}</li>\n", escape(s))).collect();
        let _ = writeln!(content.body, "<ul>{items}</ul>");
    }
    for table in of_thesis {
        let (title, text) = (escape(&table.title), escape(&table.text));
        let _ = writeln!(
            content.body,
            "<details><summary>{title}</summary><div class=\"scroll\" tabindex=\"0\"><pre>{text}</pre></div></details>"
        );
    }
    content.close();
}
