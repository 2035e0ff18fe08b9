//! All units of a fleet with intervals: one parameter or effect at a time.

use depthcal_io::Fleet;
use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{AFTER, NEUTRAL, plain, short, whiskers};
use crate::format::{number, p_value, quantity, shown_unit};

/// Standard deviations to either side of a 95 % interval.
const SIGMAS: f64 = 1.96;
const OUTLIER: &str = "#c43a57";

/// Values of all units with standard deviations, the shared mean and the scatter.
struct Line<'a> {
    label: String,
    note: String,
    /// Unit, value, standard deviation.
    values: Vec<(usize, f64, f64)>,
    mean: f64,
    between: f64,
    within: &'a str,
}

fn is_outlier(fleet: &Fleet, unit: usize, line: &Line<'_>) -> bool {
    let is_of = |parameter: &str| parameter == line.label || line.within != "model";
    fleet
        .outliers
        .iter()
        .any(|o| o.unit == unit && o.within == line.within && o.parts.iter().any(|p| is_of(&p.parameter)))
}

/// Departures from the shared mean of all units, one variant per line.
fn figure(fleet: &Fleet, id: &str, title: &str, axis: &str, lines: &[Line<'_>]) -> Figure {
    let variants: Vec<Variant> = lines
        .iter()
        .map(|line| {
            let colour = |unit: usize| match () {
                () if is_outlier(fleet, unit, line) => OUTLIER,
                () if fleet.outliers.iter().any(|o| o.unit == unit) => NEUTRAL,
                () => AFTER,
            };
            let half = |std: f64| short(SIGMAS * std);
            Variant {
                label: line.label.clone(),
                note: line.note.clone(),
                trace: json!({
                    "x": line.values.iter().map(|v| plain(&fleet.units[v.0].name)).collect::<Value>(),
                    "y": line.values.iter().map(|v| short(v.1 - line.mean)).collect::<Value>(),
                    "error_y": whiskers(
                        line.values.iter().map(|v| half(v.2)).collect(),
                        line.values.iter().map(|v| half(v.2)).collect(),
                    ),
                    "marker": {
                        "color": line.values.iter().map(|v| colour(v.0)).collect::<Value>(), "size": 8,
                    },
                }),
            }
        })
        .collect();
    let mut data = variants.first().map_or_else(|| json!({}), |v| v.trace.clone());
    data["type"] = json!("scatter");
    data["mode"] = json!("markers");
    data["hovertemplate"] = json!("%{x}: %{y:+.3~g}<extra></extra>");
    let layout = json!({
        "xaxis": {"type": "category", "tickangle": -60}, "showlegend": false,
        "yaxis": {"title": {"text": axis}, "zeroline": true},
    });
    let told: Vec<String> =
        lines.iter().map(|l| format!("{}: mean {}, scatter {}", l.label, number(l.mean), number(l.between))).collect();
    let mut figure = Figure::new(id, title, vec![data], layout)
        .caption("Departure of every unit from the shared mean, with 95 % intervals of its own data. Red: an outlier in this; grey: an \
                  outlier in something else.")
        .alt(format!("All units around the shared mean. {}.", told.join("; ")))
        .aspect(2.4);
    figure.variants = variants;
    figure
}

/// Every parameter of all units.
pub(crate) fn fleet_parameters(fleet: &Fleet) -> Figure {
    let lines: Vec<Line<'_>> = fleet
        .parameters
        .iter()
        .map(|p| Line {
            label: p.name.clone(),
            note: format!(
                "Mean {}; between units {}, from noise {}; p = {}.",
                quantity(p.mean, shown_unit(&p.unit)),
                number(p.between_units),
                number(p.of_noise),
                p_value(p.differs_p_value)
            ),
            values: p.values.iter().map(|v| (v.unit, v.value, v.std_dev)).collect(),
            mean: p.mean,
            between: p.between_units,
            within: "model",
        })
        .collect();
    figure(fleet, "fleet-parameters", "Parameters of all units", "departure from the shared mean", &lines)
}

/// Every parameter of every effect of all units; departures from doing nothing.
pub(crate) fn fleet_effects(fleet: &Fleet) -> Figure {
    let lines: Vec<Line<'_>> = fleet
        .effects
        .iter()
        .flat_map(|e| {
            (0..e.parameters.len()).map(move |k| Line {
                label: e.parameters[k].clone(),
                note: format!(
                    "Shared mean {} ± {}; between units {}; p = {}.",
                    number(e.mean[k]),
                    number(e.mean_std_dev[k]),
                    number(e.between_units[k]),
                    p_value(e.shared_p_value)
                ),
                values: e.units.iter().map(|u| (u.unit, u.values[k], u.std_dev[k])).collect(),
                mean: 0.0,
                between: e.between_units[k],
                within: &e.effect,
            })
        })
        .collect();
    figure(fleet, "fleet-effects", "Effects of all units", "estimate of every unit", &lines)
}
