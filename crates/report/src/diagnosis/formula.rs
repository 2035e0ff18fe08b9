//! A formula that was found, in words and typeset.

use std::fmt::Write;

use depthcal_formula::FormulaEffect;
use depthcal_io::{CameraDiagnosis, DiagnosisFormula};

use crate::component_plot::component_plot;
use crate::format::{join, number, percent};
use crate::formula_plot;
use crate::html::escape;

/// The form of expressions in sentences.
pub(crate) enum FormulaText {
    /// As in files.
    Plain,
    /// As elements of HTML.
    Html,
}

/// Evidence for a formula and against others, in sentences.
pub(crate) fn formula_sentences(f: &DiagnosisFormula, form: &FormulaText) -> Vec<String> {
    let expression = |text: &str| match form {
        FormulaText::Plain => text.to_owned(),
        FormulaText::Html => format!("<code>{}</code>", escape(text)),
    };
    let state = match (f.confirmed, &f.replication) {
        (true, Some(r)) => format!(
            "confirmed: in frames that the search did not see the effect is {} ± {} times as large as in the others",
            number(r.size),
            number(r.standard_error)
        ),
        (false, Some(r)) => format!(
            "a candidate only: in frames that the search did not see the effect is {} ± {} times as large as in the others",
            number(r.size),
            number(r.standard_error)
        ),
        (_, None) => "a candidate only: frames that the search did not see are too few to confirm it".to_owned(),
    };
    let mut sentences = if f.is_smooth_function() {
        let text =
            FormulaEffect::new(f.definition.clone()).map_or_else(|_| f.expression.clone(), |effect| effect.text());
        vec![format!(
            "{}: a smooth function of {}, which no effect and no formula explains as well; a description, not a cause",
            expression(&text),
            join(&f.covariates)
        )]
    } else {
        vec![
            format!(
                "{}: a formula that describes what was left; a description, not a cause",
                expression(&f.expression)
            ),
            state,
            format!(
                "the best of {} terms has the same covariates ({}) in {} of resampled captures; it explains {} of what the best free \
             function of them explains",
                f.terms,
                join(&f.covariates),
                percent(100.0 * f.stability),
                percent(100.0 * f.share_of_free_function)
            ),
        ]
    };
    for exchange in &f.covariates_not_told_apart {
        sentences.push(format!(
            "these captures cannot tell whether it depends on {} or on {}, which rise and fall together",
            exchange.covariate, exchange.instead
        ));
    }
    if !f.replaced.is_empty() {
        sentences.push(format!(
            "it took the place of {}, which explain left-out frames less well together",
            join(&f.replaced)
        ));
    }
    if !f.resembles.is_empty() {
        sentences.push(format!("nearly as much is explained by {}", join(&f.resembles)));
    }
    for other in &f.runners_up {
        sentences.push(format!(
            "lost: {}, which explains {} of it on left-out frames",
            expression(&other.expression),
            percent(100.0 * other.gain_share)
        ));
    }
    sentences
}

/// The formulas among the steps: typeset, drawn, with what speaks for them. Empty where there are none.
pub(super) fn formulas(d: &CameraDiagnosis) -> String {
    let mut html = String::new();
    for step in &d.steps {
        let Some(formula) = &step.formula else { continue };
        let Ok(effect) = FormulaEffect::new(formula.definition.clone()) else { continue };
        let items: String =
            formula_sentences(formula, &FormulaText::Html).iter().map(|s| format!("<li>{s}</li>")).collect();
        let _ = writeln!(
            html,
            "<h3>{}</h3>\n<p class=\"formula\">{}</p>\n<ul>{items}</ul>\n<div class=\"scroll\" tabindex=\"0\">{}</div>",
            escape(effect.name()),
            effect.mathml(),
            component_plot(&formula.components).unwrap_or_else(|| formula_plot(&effect))
        );
    }
    html
}
