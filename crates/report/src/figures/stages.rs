//! Depth error as measured, under the declared model and after every step, and the gain by each step.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, NEUTRAL, plain, short, whiskers};
use crate::format::{interval, number, percent};
use crate::input::{ReportCamera, ReportDiagnosis};
use crate::pool::Pool;

/// Most labels that stand side by side; more are turned.
const MOST_SIDE_BY_SIDE: usize = 6;

/// One bar.
struct Stage {
    label: String,
    value: f64,
    /// 95 % interval.
    interval: Option<[f64; 2]>,
    colour: &'static str,
}

fn stages(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> Option<Vec<Stage>> {
    let (declared, now) = (Pool::declared(d).depth_rms()?, Pool::last(camera).depth_rms()?);
    let interval = |e: &depthcal_statistics::Estimate| e.has_interval().then_some([e.low, e.high]);
    let mut list = vec![
        Stage {
            label: "as<br>measured".to_owned(),
            value: now.before.value,
            interval: interval(&now.before),
            colour: BEFORE,
        },
        Stage {
            label: format!("model:<br>{}", plain(&d.record.model.to_string())),
            value: declared.after.value,
            interval: interval(&declared.after),
            colour: NEUTRAL,
        },
    ];
    let steps = &d.record.steps;
    for (i, step) in steps.iter().enumerate() {
        let is_last = i + 1 == steps.len();
        let (value, ends) = match (is_last, step.depth_rms_after_mm) {
            (true, _) => (Some(now.after.value), interval(&now.after)),
            (false, Some(after)) => (Some(after.mean), Some([after.low, after.high])),
            (false, None) => (step.after.depth_rms_mm, None),
        };
        let name = step.effects.first().map_or("", String::as_str);
        list.push(Stage {
            label: format!("+ {}", plain(name).replace('_', "_<br>")),
            value: value?,
            interval: ends,
            colour: AFTER,
        });
    }
    Some(list)
}

/// Depth error as measured, under the declared model, and after every step.
pub(crate) fn stage_bars(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let list = stages(camera, d)?;
    let in_one_line =
        |s: &Stage| format!("{} {} mm", s.label.replace("_<br>", "_").replace("<br>", " "), number(s.value));
    let is_crowded = list.len() > MOST_SIDE_BY_SIDE;
    let label = |s: &Stage| match is_crowded {
        true => in_one_line(s),
        false => format!("{}<br><b>{} mm</b>", s.label, number(s.value)),
    };
    let bars = json!({
        "type": "bar",
        "x": list.iter().map(label).collect::<Value>(),
        "y": list.iter().map(|s| short(s.value)).collect::<Value>(),
        "marker": {"color": list.iter().map(|s| s.colour).collect::<Value>()},
        "hovertemplate": "%{y:.3~g} mm<extra></extra>",
    });
    // A trace of their own: a bar without interval would get a whisker of no length.
    let known: Vec<(&Stage, [f64; 2])> = list.iter().filter_map(|s| Some((s, s.interval?))).collect();
    let intervals = json!({
        "type": "scatter", "mode": "markers", "hoverinfo": "skip", "marker": {"size": 1, "opacity": 0},
        "x": known.iter().map(|s| label(s.0)).collect::<Value>(),
        "y": known.iter().map(|s| short(s.0.value)).collect::<Value>(),
        "error_y": whiskers(
            known.iter().map(|s| short(s.1[1] - s.0.value)).collect(),
            known.iter().map(|s| short(s.0.value - s.1[0])).collect(),
        ),
    });
    let data = vec![bars, intervals];
    // Five labels have to stand side by side on a phone.
    let size = if list.len() > 4 { 10 } else { 12 };
    let layout = json!({
        "xaxis": {"type": "category", "tickangle": if is_crowded { -60 } else { 0 }, "tickfont": {"size": size}}, "bargap": 0.25, "showlegend": false,
        "yaxis": {"title": {"text": "depth error, rms / mm"}, "rangemode": "tozero"},
    });
    let told: Vec<String> = list.iter().map(in_one_line).collect();
    Some(
        Figure::new("stages", "Depth error on held-out frames", data, layout)
            .caption("Every model is fitted separately. Whiskers: 95 % intervals from resampling whole frames.")
            .alt(format!("Bars of the depth error: {}.", told.join("; ")))
            .aspect(1.35),
    )
}

/// Decrease of the error by each step given all others, per cent, with intervals; `None` without steps.
pub(crate) fn step_gains(d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let list: Vec<_> = d.record.steps.iter().filter_map(|s| Some((plain(s.effects.first()?), s.gain()?))).collect();
    if list.is_empty() {
        return None;
    }
    let data = json!({
        "type": "bar", "orientation": "h",
        "y": list.iter().map(|s| s.0.clone()).collect::<Value>(),
        "x": list.iter().map(|s| short(s.1.value)).collect::<Value>(),
        "error_x": whiskers(
            list.iter().map(|s| short(s.1.high - s.1.value)).collect(),
            list.iter().map(|s| short(s.1.value - s.1.low)).collect(),
        ),
        "marker": {"color": list.iter().map(|s| if s.1.is_certain() { AFTER } else { NEUTRAL }).collect::<Value>()},
        "hovertemplate": "%{y}: %{x:.1f} %<extra></extra>",
    });
    let layout = json!({
        "yaxis": {"type": "category", "autorange": "reversed"}, "showlegend": false,
        "xaxis": {"title": {"text": "decrease of the error / %"}, "zeroline": true},
    });
    let told: Vec<String> =
        list.iter().map(|(n, g)| format!("{n} {} ({})", percent(g.value), interval(g.low, g.high, "%"))).collect();
    Some(
        Figure::new("step-gains", "Gain by each step", vec![data], layout)
            .caption(format!(
                "Decrease of the error on left-out frames by each, given all others, with 95 % intervals from resampling the same \
                 frames for both: {}. Grey: not significant.",
                told.join("; ")
            ))
            .alt(format!("Bars of the gain by each step: {}.", told.join("; ")))
            .aspect(2.4),
    )
}
