//! Distribution of reprojection residuals.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, NEUTRAL, short, shorts};
use crate::format::{number, percent};
use crate::input::ReportCamera;
use crate::pool::Pool;
use depthcal_statistics::{quantile, rms};

const BINS: usize = 41;
/// The axis ends at this quantile of the residuals' sizes.
const SHOWN: f64 = 0.995;

/// Residuals of both coordinates, and the normal distribution of their central part; `None` without markers.
pub(crate) fn residual_histogram(camera: &ReportCamera<'_>) -> Option<Figure> {
    let (pool, _) = Pool::headline(camera);
    let residuals: Vec<f64> = pool
        .frames
        .iter()
        .flat_map(|f| f.frame.reprojection.iter().flat_map(|e| [e[2], e[3]]))
        .filter(|residual| residual.is_finite())
        .collect();
    let end = quantile(residuals.iter().map(|r| r.abs()), SHOWN);
    if residuals.len() < BINS || !(end > 0.0) {
        return None;
    }
    let width = 2.0 * end / BINS as f64;
    let mut counts = vec![0_usize; BINS];
    for residual in &residuals {
        let bin = ((residual + end) / width).floor();
        if (0.0..BINS as f64).contains(&bin) {
            counts[bin as usize] += 1;
        }
    }
    let middle = |bin: usize| -end + (bin as f64 + 0.5) * width;
    let density = |bin: usize| counts[bin] as f64 / (residuals.len() as f64 * width);
    // The width of a normal distribution with this median of sizes: a few large residuals do not widen it.
    let sigma = quantile(residuals.iter().map(|r| r.abs()), 0.5) / 0.6745;
    let normal = |x: f64| (-0.5 * (x / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt());
    let beyond = residuals.iter().filter(|r| r.abs() > 3.0 * sigma).count() as f64 / residuals.len() as f64;
    let data: Vec<Value> = vec![
        json!({
            "type": "bar", "name": "residuals", "x": shorts((0..BINS).map(middle)), "y": shorts((0..BINS).map(density)),
            "width": short(width), "marker": {"color": AFTER}, "hovertemplate": "%{x:.3~g} px<extra></extra>",
        }),
        json!({
            "type": "scatter", "mode": "lines", "name": "normal distribution", "x": shorts((0..BINS).map(middle)),
            "y": shorts((0..BINS).map(|bin| normal(middle(bin)))), "line": {"color": NEUTRAL, "width": 2},
            "hoverinfo": "skip",
        }),
    ];
    let layout = json!({
        "xaxis": {"title": {"text": "detected minus projected, u and v / px"}},
        "yaxis": {"title": {"text": "density / px⁻¹"}, "rangemode": "tozero"}, "bargap": 0,
    });
    let told = format!(
        "{} px rms per coordinate; the central half has a standard deviation of {} px, and {} lie beyond three of these (0.27 % of a \
         normal distribution)",
        number(rms(residuals.iter().copied())),
        number(sigma),
        percent(100.0 * beyond)
    );
    Some(
        Figure::new("residual-histogram", "Distribution of reprojection residuals", data, layout)
            .caption(format!("{told}."))
            .alt(format!("Histogram of reprojection residuals. {told}."))
            .aspect(1.45),
    )
}
