//! Depth models compared: their errors with intervals, and their errors against the number of frames in the fit.

use depthcal_io::{Comparison, Errors, ModelComparison};
use depthcal_model::{ModelSpec, Register};
use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{AFTER, NEUTRAL, plain, short, whiskers};
use crate::format::{count, number};
use depthcal_statistics::quantile;

/// A kind of error: its name and how to get it.
type Kind<T> = (&'static str, fn(&Errors<T>) -> T);

fn kinds<T: Copy>() -> [Kind<T>; 3] {
    [
        ("dot error, mean", |e| e.dot_error_mm),
        ("plane error, mean", |e| e.plane_error_mm),
        ("depth error, rms", |e| e.depth_rms_mm),
    ]
}

/// Errors of all models with intervals, best first.
pub(crate) fn model_ranking(c: &Comparison, register: &Register) -> Figure {
    let models: Vec<&ModelComparison> = c.models.iter().filter(|m| m.failed.is_none()).collect();
    let variants: Vec<Variant> = kinds()
        .into_iter()
        .map(|(kind, of)| {
            let errors: Vec<_> = models.iter().map(|m| of(&m.held_out)).collect();
            let each = |f: fn(&depthcal_io::Interval) -> f64| -> Value {
                errors.iter().map(|e| e.as_ref().map_or(Value::Null, |i| short(f(i)))).collect()
            };
            let longest = errors.iter().flatten().map(|i| i.high).fold(0.0, f64::max);
            Variant {
                label: kind.to_owned(),
                note: format!("{kind}, mm, on held-out data; whiskers: 95 % intervals."),
                trace: json!({
                    "x": each(|i| i.mean),
                    "error_x": whiskers(each(|i| i.high - i.mean), each(|i| i.mean - i.low)),
                    "text": errors.iter().map(|e| bar_text(e.as_ref(), longest)).collect::<Value>(),
                }),
            }
        })
        .collect();
    let mut data = variants[0].trace.clone();
    data["type"] = json!("bar");
    data["orientation"] = json!("h");
    data["y"] = models.iter().map(|m| plain(&register.model_words(&m.model))).collect();
    data["textposition"] = json!("inside");
    data["insidetextanchor"] = json!("start");
    data["textfont"] = json!({"color": "#ffffff"});
    data["marker"] =
        json!({"color": models.iter().map(|m| if m.really_worse { NEUTRAL } else { AFTER }).collect::<Value>()});
    data["hovertemplate"] = json!("%{y}: %{x:.3~g} mm<extra></extra>");
    let layout = json!({
        "yaxis": {"type": "category", "autorange": "reversed", "dtick": 1}, "showlegend": false,
        "xaxis": {"title": {"text": "error on held-out data / mm"}, "rangemode": "tozero"},
    });
    let best = models.first().map_or("–".to_owned(), |m| register.model_words(&m.model));
    let mut figure = Figure::new("ranking", "Depth models, best dot error first", vec![data], layout)
        .caption("Grey: significantly worse than the best model, corrected for the number of models; blue: not \
                  significantly worse. All models are evaluated on the same frames, so that differences are more certain \
                  than the whiskers suggest.")
        .alt(format!("Ranking of {}; the best is {best}.", count(models.len(), "model")))
        .aspect(2.6);
    figure.variants = variants;
    figure
}

/// The number inside a bar; empty where the bar is too short for it.
fn bar_text(error: Option<&depthcal_io::Interval>, longest: f64) -> String {
    const SHORTEST: f64 = 0.08;
    error.map_or_else(|| "–".to_owned(), |i| if i.mean < SHORTEST * longest { String::new() } else { number(i.mean) })
}

/// Most reasons of failed fits in the caption; the tables have all.
const REASONS: usize = 3;

/// Errors against the number of frames in the fit.
pub(crate) fn learning_curve(c: &Comparison, register: &Register) -> Figure {
    let mut models: Vec<&ModelSpec> = Vec::new();
    for point in &c.learning_curve {
        if !models.contains(&&point.model) {
            models.push(&point.model);
        }
    }
    let symbols = ["circle", "square", "diamond", "cross", "x", "triangle-up", "triangle-down", "star", "pentagon"];
    let colours = ["#1f86c7", "#d9730d", "#a05fb4", "#2a9d6f", "#808793", "#c43a57", "#8a6d1b", "#2b59a8", "#5f9ea0"];
    let points = |model: &ModelSpec| c.learning_curve.iter().filter(|p| p.model == *model).collect::<Vec<_>>();
    let dot_error = kinds::<Option<f64>>()[0].1;
    let mut data = Vec::new();
    for (i, model) in models.iter().enumerate() {
        let list = points(model);
        data.push(json!({
            "type": "scatter", "mode": "lines+markers", "name": plain(&register.model_words(model)),
            "x": list.iter().map(|p| p.frames).collect::<Value>(),
            "y": list.iter().map(|p| dot_error(&p.held_out).map_or(Value::Null, short)).collect::<Value>(),
            "line": {"color": colours[i % colours.len()], "width": 2},
            "marker": {"size": 7, "symbol": symbols[i % symbols.len()], "color": colours[i % colours.len()]},
            "hovertemplate": "%{x} frames: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
        }));
    }
    let values = || c.learning_curve.iter().filter_map(|p| dot_error(&p.held_out));
    let (low, high) = (values().fold(f64::INFINITY, f64::min), quantile(values(), 0.9));
    let sizes: Vec<usize> = {
        let mut sizes: Vec<usize> = c.learning_curve.iter().map(|p| p.frames).collect();
        sizes.sort_unstable();
        sizes.dedup();
        sizes
    };
    let layout = json!({
        "xaxis": {"title": {"text": "frames in the fit"}, "type": "log", "tickvals": sizes, "ticktext": sizes},
        "yaxis": {"title": {"text": "dot error / mm"}, "type": "log",
                  "range": [(0.9 * low).max(1e-3).log10(), (1.6 * high).max(2e-3).log10()]},
    });
    let failed: usize = c.learning_curve.iter().map(|p| p.failed).sum();
    let mut reasons: Vec<String> = c
        .learning_curve
        .iter()
        .filter(|p| p.failed > 0)
        .map(|p| {
            format!("{} with {}: {}", register.model_words(&p.model), count(p.frames, "frame"), p.reasons.join("; "))
        })
        .collect();
    reasons.truncate(REASONS);
    let failures = match failed {
        0 => String::new(),
        n => format!(" {} failed and are not shown ({}).", count(n, "fit"), plain(&reasons.join(". "))),
    };
    Figure::new("learning-curve", "Dot error against the number of frames", data, layout)
        .caption(format!("Mean over fits to randomly drawn frames, the same ones for all models.{failures}"))
        .alt(format!("Dot error of {} against the number of frames in the fit.", count(models.len(), "model")))
        .aspect(2.4)
}
