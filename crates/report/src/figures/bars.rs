//! Errors before and after as bars with intervals.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, axis, plain, short, whiskers};
use crate::format::number;
use crate::input::{ReportCamera, Role};
use crate::pool::Pool;
use depthcal_calibration::judge::intervals::Change;
use depthcal_statistics::Estimate;

fn bar(name: &str, colour: &str, labels: &[String], values: &[Estimate], hatched: bool) -> Value {
    let interval = |e: &Estimate, side: f64| if e.has_interval() { short((side - e.value).abs()) } else { json!(0) };
    json!({
        "type": "bar",
        "name": name,
        "x": labels,
        "y": values.iter().map(|e| short(e.value)).collect::<Value>(),
        "error_y": whiskers(
            values.iter().map(|e| interval(e, e.high)).collect(),
            values.iter().map(|e| interval(e, e.low)).collect(),
        ),
        "marker": {"color": colour, "pattern": {"shape": if hatched { "/" } else { "" }, "solidity": 0.25}},
        "hovertemplate": "%{x}: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
    })
}

fn pair(labels: &[String], changes: &[Change]) -> Vec<Value> {
    let before: Vec<Estimate> = changes.iter().map(|c| c.before).collect();
    let after: Vec<Estimate> = changes.iter().map(|c| c.after).collect();
    vec![bar("as measured", BEFORE, labels, &before, true), bar("corrected", AFTER, labels, &after, false)]
}

fn layout() -> Value {
    let mut y = axis("mm");
    y["rangemode"] = json!("tozero");
    json!({"barmode": "group", "bargap": 0.3, "yaxis": y, "xaxis": {"type": "category"}})
}

/// Depth, plane and dot error of the headline's frames, before and after correction.
pub(crate) fn headline_bars(camera: &ReportCamera<'_>) -> Option<Figure> {
    let (pool, role) = Pool::headline(camera);
    let errors =
        [("depth, rms", pool.depth_rms()), ("plane, mean", pool.plane_error()), ("dot, mean", pool.dot_error())];
    let (labels, changes): (Vec<String>, Vec<Change>) =
        errors.into_iter().filter_map(|(name, c)| Some((name.to_owned(), c?))).unzip();
    if changes.is_empty() {
        return None;
    }
    let title = match role {
        Role::Fitted => "Errors on the fitted frames",
        Role::HeldOut => "Errors on held-out frames",
        Role::Other => "Errors on captures that are not part of the fit",
    };
    let told: Vec<String> = labels
        .iter()
        .zip(&changes)
        .map(|(l, c)| format!("{l}: {} mm before, {} mm after", number(c.before.value), number(c.after.value)))
        .collect();
    Some(
        Figure::new("errors", title, pair(&labels, &changes), layout())
            .caption("Whiskers: 95 % intervals from resampling whole frames.")
            .alt(format!("Bars of errors before and after correction. {}.", told.join("; ")))
            .aspect(1.45),
    )
}

/// Mean dot and plane error of every dataset; empty with less than two datasets.
pub(crate) fn by_dataset(camera: &ReportCamera<'_>) -> Vec<Figure> {
    if camera.evaluations.len() < 2 {
        return Vec::new();
    }
    let figure = |id: &str, title: &str, of: &dyn Fn(&Pool<'_>) -> Option<Change>| {
        let (labels, changes): (Vec<String>, Vec<Change>) = camera
            .evaluations
            .iter()
            .filter_map(|d| {
                let role = match d.role {
                    Role::Fitted | Role::HeldOut => format!(" ({})", d.role.name()),
                    Role::Other => String::new(),
                };
                Some((format!("{}{role}", plain(&d.evaluated.name)), of(&Pool::one(d))?))
            })
            .unzip();
        let caption = "Per dataset, with 95 % intervals from resampling its frames.";
        (!changes.is_empty()).then(|| {
            Figure::new(id, title, pair(&labels, &changes), layout())
                .caption(caption)
                .alt(format!("Bars before and after correction for {} datasets.", labels.len()))
                .aspect(1.7)
        })
    };
    [
        figure("dots-by-dataset", "Mean dot error by dataset", &|p| p.dot_error()),
        figure("plane-by-dataset", "Mean plane error by dataset", &|p| p.plane_error()),
    ]
    .into_iter()
    .flatten()
    .collect()
}
