//! Reprojection errors as a vector field over the image.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, NEUTRAL, image_axes, round_factor, rounded};
use crate::covariates::Image;
use crate::format::{number, significant};
use crate::input::{ReportCamera, Role};
use crate::pool::Pool;
use depthcal_statistics::quantile;

/// Most arrows of single markers.
const ARROWS: usize = 1500;
/// Length that a typical arrow gets, as a share of the image's width.
const LENGTH: f64 = 0.025;
/// Fewest markers of a mean arrow.
const FEWEST: usize = 4;

/// Lines from a to b, separated by gaps.
fn lines(arrows: impl Iterator<Item = [[f64; 2]; 2]>) -> (Value, Value) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for [from, to] in arrows {
        x.extend([rounded(from[0], 1), rounded(to[0], 1), Value::Null]);
        y.extend([rounded(from[1], 1), rounded(to[1], 1), Value::Null]);
    }
    (Value::Array(x), Value::Array(y))
}

/// Mean place and mean error of the markers of a cell of the image, px, and their number; cells with few markers are left out.
/// An error is u, v, and the error of both.
fn means_by_cell(errors: &[[f64; 4]], image: &Image) -> Vec<([f64; 2], [f64; 2], usize)> {
    let grid = image.grid(12);
    let mut sums = vec![([0.0; 2], [0.0; 2], 0_usize); grid[0] * grid[1]];
    for e in errors {
        if let Some(c) = image.cell(grid, [e[0], e[1]]) {
            let (place, error, n) = &mut sums[c];
            *place = [place[0] + e[0], place[1] + e[1]];
            *error = [error[0] + e[2], error[1] + e[3]];
            *n += 1;
        }
    }
    let mean =
        |(place, error, n): ([f64; 2], [f64; 2], usize)| (place.map(|v| v / n as f64), error.map(|v| v / n as f64), n);
    sums.into_iter().filter(|s| s.2 >= FEWEST).map(mean).collect()
}

/// The field; `None` without any reprojection error.
pub(crate) fn reprojection_field(camera: &ReportCamera<'_>, image: &Image) -> Option<Figure> {
    let pool = Pool::of(camera, |_| true);
    let errors: Vec<[f64; 4]> = pool
        .frames
        .iter()
        .flat_map(|f| f.frame.reprojection.iter().copied())
        .filter(|e| e.iter().all(|v| v.is_finite()))
        .collect();
    if errors.is_empty() {
        return None;
    }
    let typical = quantile(errors.iter().map(|e| e[2].hypot(e[3])), 0.75).max(1e-6);
    let factor = round_factor(LENGTH * image.width / typical);
    let arrow = |at: [f64; 2], d: [f64; 2], k: f64| [at, [at[0] + k * d[0], at[1] + k * d[1]]];

    let step = errors.len().div_ceil(ARROWS);
    let (x, y) = lines(errors.iter().step_by(step).map(|e| arrow([e[0], e[1]], [e[2], e[3]], factor)));
    let single = json!({
        "type": "scatter", "mode": "lines", "name": "markers", "x": x, "y": y, "hoverinfo": "skip",
        "line": {"color": NEUTRAL, "width": 1}, "opacity": 0.55,
    });

    let means = means_by_cell(&errors, image);
    // Means are shorter than single errors by the root of their number, and would be too short to see.
    let emphasis = 3.0;
    let (x, y) = lines(means.iter().map(|(place, error, _)| arrow(*place, *error, emphasis * factor)));
    let shafts = json!({
        "type": "scatter", "mode": "lines", "x": x, "y": y, "hoverinfo": "skip", "showlegend": false,
        "line": {"color": AFTER, "width": 2.5},
    });
    let tip =
        |i: usize| -> Value { means.iter().map(|(at, d, _)| rounded(at[i] + emphasis * factor * d[i], 1)).collect() };
    let heads = json!({
        "type": "scatter", "mode": "markers", "name": format!("mean of a cell, {emphasis} × longer"),
        "x": tip(0), "y": tip(1),
        "marker": {"symbol": "triangle-up", "size": 9, "color": AFTER,
                   "angle": means.iter().map(|(_, d, _)| rounded(d[0].atan2(-d[1]).to_degrees(),
                    0)).collect::<Value>()},
        "text": means.iter().map(|(_, d, n)| format!("({}, {}) px, mean of {n}", number(d[0]), number(d[1])))
            .collect::<Value>(),
        "hovertemplate": "%{text}<extra></extra>",
    });
    let rms = pool.reprojection().map_or(f64::NAN, |e| e.0.value);
    let held_out = Pool::of(camera, |r| r != Role::Fitted).reprojection();
    let held_out = held_out.map_or(String::new(), |e| format!(", {} px on held-out frames", number(e.0.value)));
    let shown = if step > 1 { format!("; one marker in {step} is drawn") } else { String::new() };
    Some(
        Figure::new(
            "reprojection-field",
            "Reprojection errors over the image",
            vec![single, shafts, heads],
            image_axes(image),
        )
        .caption(format!(
            "Detected minus projected position, enlarged {} × (means of cells {} ×){shown}. Rms {} px over {} \
             markers{held_out}. Blue arrows that point the same way over a region show an error of lens or focal length that \
             the model lacks; arrows in random directions are noise.",
            significant(factor, 1),
            significant(emphasis * factor, 1),
            number(rms),
            errors.len()
        ))
        .alt(format!("Vector field of {} reprojection errors, {} px rms.", errors.len(), number(rms)))
        .aspect(image.width / image.height * 1.02),
    )
}
