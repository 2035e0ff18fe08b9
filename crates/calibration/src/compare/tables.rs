//! The comparison as text: the ranking, and the thesis' tables 6.1 to 6.9 and A.1 (Sjöholm 2017).

use std::fmt::Write;

use depthcal_io::{Comparison, DatasetEvaluation, Interval, MeanStd, ModelComparison};
use depthcal_model::ModelSpec;

use super::variants::subsets;
use crate::judge::table::table;

/// A titled block of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Title.
    pub title: String,
    /// Lines of equal columns.
    pub text: String,
}

fn cell(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.2}"))
}

fn with_interval(value: Option<Interval>) -> String {
    value.map_or_else(|| "–".to_owned(), |i| format!("{:.2} ({:.2}–{:.2})", i.mean, i.low, i.high))
}

/// All tables for which the comparison has numbers.
pub fn tables(c: &Comparison) -> Vec<Table> {
    let mut all = vec![ranking(c)];
    all.extend(learning(c));
    let variant = |model: &str, estimator: &str| {
        c.variants.iter().find(|v| {
            v.model.to_string() == model && v.estimator == estimator && v.lens != "none" && v.failed.is_none()
        })
    };
    for (number, model) in [("6.1", "projective"), ("6.4", "projective:xw")] {
        for estimator in ["nonlinear", "joint"] {
            if let Some(v) = variant(model, estimator).filter(|_| c.variants.len() > c.models.len()) {
                let title = format!("Table {number}: errors per dataset, {model}, {estimator} (* fitted)");
                all.push(Table { title, text: table(&v.per_dataset, Some(&c.train)) });
            }
        }
    }
    if let Some(stability) = &c.stability {
        for (title, model, estimators) in [
            ("Table 6.2: D refitted to each dataset, linear", "projective", &["linear"][..]),
            (
                "Table 6.3: D refitted to each dataset, all estimators",
                "projective",
                &["linear", "irls", "nonlinear", "joint"],
            ),
            (
                "Table 6.5: dx and dw refitted to each dataset",
                "projective:xw",
                &["linear", "irls", "nonlinear", "joint"],
            ),
        ] {
            let mut text =
                format!("{:20} {:10} {:>20} {:>20} {:>20} {:>18}\n", "dataset", "estimator", "dx", "dy", "dz", "dw");
            for e in
                stability.estimates.iter().filter(|e| e.model == model && estimators.contains(&e.estimator.as_str()))
            {
                let star = if e.dataset == c.train { "*" } else { "" };
                let value = |i: usize| {
                    let half = e.half_width.map_or_else(String::new, |h| format!(" ± {:.1e}", h[i]));
                    if i == 3 { format!("{:.5}{half}", e.d[i]) } else { format!("{:.2e}{half}", e.d[i]) }
                };
                let name = format!("{}{star}", e.dataset);
                let [dx, dy, dz, dw] = [0, 1, 2, 3].map(value);
                let _ = writeln!(text, "{name:20} {:10} {dx:>20} {dy:>20} {dz:>20} {dw:>18}", e.estimator);
            }
            all.push(Table { title: title.to_owned(), text });
        }
        let title = "Stability of D (section 7.1.2)".to_owned();
        all.push(Table { title, text: stability.verdict.join("\n") + "\n" });
    }
    if c.variants.len() > c.models.len() {
        let title = "Tables 6.6–6.9: subsets of D, averaged over the datasets that the fit did not see".to_owned();
        all.push(Table { title, text: subset_table(c, |v| averaged(&v.per_dataset[1..])) });
        let datasets = c.variants.iter().find(|v| v.failed.is_none()).map_or(0, |v| v.per_dataset.len());
        for d in 0..datasets {
            let name = c.variants.iter().find_map(|v| v.per_dataset.get(d)).map_or("", |e| e.name.as_str());
            let star = if d == 0 { "*" } else { "" };
            let title = format!("Table A.1: {name}{star}");
            all.push(Table { title, text: subset_table(c, |v| averaged(v.per_dataset.get(d..d + 1)?)) });
        }
    }
    all
}

fn ranking(c: &Comparison) -> Table {
    let mut text = format!(
        "{:34} {:>6} {:>9}  {:>8} {:>22} {:>22} {:>22} {:>10} {:>22}  {:>9} {:>9}\n",
        "model",
        "param.",
        "effective",
        "fit dot",
        "held-out dot/mm",
        "plane/mm",
        "depth rms/mm",
        "left out/%",
        "dot − best/mm",
        "ΔAIC",
        "ΔBIC"
    );
    for m in &c.models {
        if let Some(reason) = &m.failed {
            let _ = writeln!(text, "{:34} failed: {reason}", m.model.to_string());
            continue;
        }
        let real = if m.really_worse { "!" } else { " " };
        let criterion = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.0}"));
        let _ = writeln!(
            text,
            "{:34} {:>6} {:>9.1}  {:>8} {:>22} {:>22} {:>22} {:>10} {:>21}{real}  {:>9} {:>9}",
            m.model.to_string(),
            m.parameters,
            m.effective_parameters,
            cell(m.fit.dot_error_mm),
            with_interval(m.held_out.dot_error_mm),
            with_interval(m.held_out.plane_error_mm),
            with_interval(m.held_out.depth_rms_mm),
            cell(m.left_out_share().map(|share| 100.0 * share)),
            with_interval(m.worse_than_best_mm),
            criterion(m.aic),
            criterion(m.bic),
        );
    }
    text += "! the difference from the best is real (95 %, all comparisons allowed for)\n";
    Table { title: "Models, best first by the held-out dot error (95 % intervals over frames)".to_owned(), text }
}

fn learning(c: &Comparison) -> Option<Table> {
    let mut sizes: Vec<usize> = c.learning_curve.iter().map(|p| p.frames).collect();
    sizes.sort_unstable();
    sizes.dedup();
    if sizes.is_empty() {
        return None;
    }
    let mut text = format!("{:34}", "frames in the fit");
    sizes.iter().for_each(|n| _ = write!(text, " {n:>8}"));
    text.push('\n');
    for model in &c.models {
        let _ = write!(text, "{:34}", model.model.to_string());
        for n in &sizes {
            let point = c.learning_curve.iter().find(|p| p.model == model.model && p.frames == *n);
            let value = point.and_then(|p| p.held_out.dot_error_mm.or(p.held_out.depth_rms_mm));
            let _ = write!(text, " {:>8}", cell(value));
        }
        text.push('\n');
    }
    for point in c.learning_curve.iter().filter(|p| p.failed > 0) {
        let why = point.reasons.join("; ");
        let _ = writeln!(
            text,
            "{} with {} frames: {} of {} fits failed ({why})",
            point.model, point.frames, point.failed, point.fits
        );
    }
    Some(Table { title: "Held-out dot error against the number of frames, mm".to_owned(), text })
}

/// Dot and plane error after correction, averaged over datasets.
fn averaged(datasets: &[DatasetEvaluation]) -> Option<[MeanStd; 2]> {
    let mean = |pick: &dyn Fn(&DatasetEvaluation) -> Option<MeanStd>| {
        let values: Vec<MeanStd> = datasets.iter().filter_map(pick).collect();
        let n = values.len() as f64;
        let average = |f: &dyn Fn(&MeanStd) -> f64| values.iter().map(f).sum::<f64>() / n;
        (!values.is_empty()).then(|| MeanStd { mean: average(&|v| v.mean), std: average(&|v| v.std) })
    };
    Some([mean(&|d| Some(d.dot_error_mm?.after))?, mean(&|d| Some(d.plane_error_mm?.after))?])
}

fn subset_table(c: &Comparison, of: impl Fn(&ModelComparison) -> Option<[MeanStd; 2]>) -> String {
    let mut text = format!("{:32} {:>29}   {:>29}\n", "", "nonlinear (as in the thesis)", "joint adjustment");
    let _ = writeln!(text, "{:32} {:>14} {:>14}   {:>14} {:>14}", "mean (std), mm", "dot", "plane", "dot", "plane");
    let mut rows: Vec<(String, &str, String)> = Vec::new();
    for model in subsets().iter().map(ModelSpec::to_string) {
        let label = match model.as_str() {
            "projective" => "with lens, all parameters".to_owned(),
            "none" => "with lens, no depth correction".to_owned(),
            subset => format!("with lens, only {}", subset.trim_start_matches("projective:")),
        };
        rows.push((label, "brown-conrady", model));
    }
    rows.push(("without lens, all parameters".to_owned(), "none", "projective".to_owned()));
    for (label, lens, model) in rows {
        let _ = write!(text, "{label:32}");
        for estimator in ["nonlinear", "joint"] {
            let variant = c.variants.iter().find(|v| {
                v.model.to_string() == model && v.lens == lens && v.estimator == estimator && v.failed.is_none()
            });
            let value = |m: MeanStd| format!("{:.1} ({:.1})", m.mean, m.std);
            let cells = variant.and_then(&of).map_or(["–".to_owned(), "–".to_owned()], |pair| pair.map(value));
            let _ = write!(text, " {:>14} {:>14}  ", cells[0], cells[1]);
        }
        text.push('\n');
    }
    text
}
