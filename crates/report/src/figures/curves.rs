//! Depth errors against what they may depend on.

use rayon::prelude::*;
use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, rounded, short};
use crate::binned::{Axis, Binned, Cell};
use crate::covariates::{BINS, Covariate, Image};
use crate::format::number;
use crate::html::escape;
use crate::input::ReportCamera;
use crate::leftover::{noise_mm, tested_frames};
use crate::pool::Pool;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_statistics::quantile;

/// Most single pixels that are drawn behind the bins, before and after correction each.
const POINTS: usize = 700;

/// Bins as points with intervals.
pub(super) fn bins(cells: &[Cell], axis: &Axis, shift: f64, name: &str, colour: &str, symbol: &str) -> Value {
    // A thin line for depth as measured, which is the background of corrected depth.
    let width = if colour == AFTER { 2.5 } else { 1.0 };
    let used: Vec<(usize, &Cell)> = cells.iter().enumerate().filter(|(_, c)| c.value.is_finite()).collect();
    json!({
        "type": "scatter", "mode": "lines+markers", "name": name,
        "x": used.iter().map(|(i, _)| short(axis.middle(*i) + shift * axis.width())).collect::<Value>(),
        "y": used.iter().map(|(_, c)| short(c.value)).collect::<Value>(),
        "error_y": {"type": "data", "array": used.iter().map(|(_, c)| short(c.half)).collect::<Value>(),
                    "thickness": 1.5, "width": 3, "color": colour},
        "line": {"color": colour, "width": width}, "marker": {"color": colour, "size": 7, "symbol": symbol},
        "customdata": used.iter().map(|(_, c)| c.frames).collect::<Value>(),
        "hovertemplate": "%{x:.4~g}: %{y:+.3~g} mm, %{customdata} frames<extra>%{fullData.name}</extra>",
    })
}

/// Errors against each covariate that is known and varies.
pub(crate) fn curves(camera: &ReportCamera<'_>, covariates: &[Covariate]) -> Vec<Figure> {
    let pool = tested_frames(camera);
    let errors = [|p: &PixelError| p.before_mm, |p: &PixelError| p.after_mm];
    let reach = |q: f64| errors.map(|error| quantile(pool.pixels().map(error), q));
    let [low, high] = [0.01, 0.99].map(reach);
    let (low, high) = (low[0].min(low[1]), high[0].max(high[1]));
    let pad = 0.08 * (high - low).max(1e-6);
    covariates.par_iter().filter_map(|c| curve(camera, &pool, c, [low - pad, high + pad])).collect()
}

/// Errors from `low` to `high` against one covariate; `None` where it is unknown or does not vary.
fn curve(camera: &ReportCamera<'_>, pool: &Pool<'_>, covariate: &Covariate, [low, high]: [f64; 2]) -> Option<Figure> {
    let axis = Axis::over(pool.pixels().map(&covariate.value), BINS)?;
    let cells = |value: &dyn Fn(&PixelError) -> f64| {
        Binned::new(pool, BINS, |p| axis.bin((covariate.value)(p)), value, noise_mm(camera)).cells()
    };
    let (before, after) = (cells(&|p| p.before_mm), cells(&|p| p.after_mm));
    let n = pool.pixels().count();
    let step = n.div_ceil(POINTS).max(1);
    let cloud = |value: &dyn Fn(&PixelError) -> f64, colour: &str| {
        // A stride that shares factors with the pixels' rows would draw stripes.
        let chosen: Vec<&PixelError> = pool
            .pixels()
            .enumerate()
            .filter(|(i, _)| i.wrapping_mul(2_654_435_761) % step == 0)
            .map(|(_, p)| p)
            .collect();
        json!({
            "type": "scatter", "mode": "markers", "hoverinfo": "skip", "showlegend": false,
            "x": chosen.iter().map(|p| short((covariate.value)(p))).collect::<Value>(),
            "y": chosen.iter().map(|p| rounded(value(p), 2)).collect::<Value>(),
            "marker": {"color": colour, "size": 3, "opacity": 0.28},
        })
    };
    let data = vec![
        cloud(&|p| p.before_mm, BEFORE),
        cloud(&|p| p.after_mm, AFTER),
        bins(&before, &axis, -0.08, "as measured", BEFORE, "circle-open"),
        bins(&after, &axis, 0.08, "corrected", AFTER, "circle"),
    ];
    let layout = json!({
        "xaxis": {"title": {"text": format!("{} / {}", covariate.name, covariate.unit)}},
        "yaxis": {"title": {"text": "depth error / mm"}, "range": [low, high], "zeroline": true},
    });
    let spread = |cells: &[Cell]| {
        let extreme =
            |f: fn(f64, f64) -> f64, from: f64| cells.iter().map(|c| c.value).filter(|v| v.is_finite()).fold(from, f);
        format!("{} to {}", number(extreme(f64::min, f64::INFINITY)), number(extreme(f64::max, f64::NEG_INFINITY)))
    };
    let told = format!("Bins range from {} mm as measured and from {} mm corrected", spread(&before), spread(&after));
    Some(
        Figure::new(format!("against-{}", covariate.id), format!("Against the {}", covariate.name), data, layout)
            .caption(format!("{} {told}.", escape(covariate.hint)))
            .alt(format!("Depth error against the {}. {told}.", covariate.name))
            .aspect(1.45),
    )
}

/// Radial reprojection errors against the radius, which show lens distortion that the model lacks.
pub(crate) fn image_trend(camera: &ReportCamera<'_>, image: &Image) -> Option<Figure> {
    let pool = Pool::of(camera, |_| true);
    let radial = |e: &[f64; 4]| {
        let (x, y) = (e[0] - image.centre[0], e[1] - image.centre[1]);
        let r = x.hypot(y);
        (r, (x * e[2] + y * e[3]) / r.max(1e-9))
    };
    let all: Vec<(f64, f64)> = pool
        .frames
        .iter()
        .flat_map(|f| f.frame.reprojection.iter().map(radial))
        .filter(|(r, e)| r.is_finite() && e.is_finite())
        .collect();
    let axis = Axis::over(all.iter().map(|p| p.0), BINS)?;
    let mut sums = vec![(0.0, 0.0, 0_usize); BINS];
    for (r, e) in &all {
        if let Some(b) = axis.bin(*r) {
            sums[b] = (sums[b].0 + e, sums[b].1 + e * e, sums[b].2 + 1);
        }
    }
    let means: Vec<(f64, f64, f64)> = sums
        .iter()
        .enumerate()
        .filter(|(_, s)| s.2 > 3)
        .map(|(i, (s, q, n))| {
            let n = *n as f64;
            (axis.middle(i), s / n, 1.96 * ((q / n - (s / n).powi(2)).max(0.0) / n).sqrt())
        })
        .collect();
    let step = all.len().div_ceil(POINTS).max(1);
    let cloud = json!({
        "type": "scatter", "mode": "markers", "hoverinfo": "skip", "showlegend": false,
        "x": all.iter().step_by(step).map(|p| short(p.0)).collect::<Value>(),
        "y": all.iter().step_by(step).map(|p| short(p.1)).collect::<Value>(),
        "marker": {"color": super::plotly::NEUTRAL, "size": 3, "opacity": 0.4},
    });
    let line = json!({
        "type": "scatter", "mode": "lines+markers", "name": "mean of a bin", "showlegend": false,
        "x": means.iter().map(|m| short(m.0)).collect::<Value>(),
        "y": means.iter().map(|m| short(m.1)).collect::<Value>(),
        "error_y": {"type": "data", "array": means.iter().map(|m| short(m.2)).collect::<Value>(), "thickness": 1.5,
                    "width": 3},
        "line": {"color": AFTER}, "marker": {"color": AFTER, "size": 7},
        "hovertemplate": "%{x:.0f} px: %{y:+.3~g} px<extra></extra>",
    });
    let layout = json!({
        "xaxis": {"title": {"text": "radius in the image / px"}},
        "yaxis": {"title": {"text": "radial error / px"}, "zeroline": true},
    });
    Some(
        Figure::new("reprojection-radius", "Reprojection error against the radius", vec![cloud, line], layout)
            .caption(
                "Component of each reprojection error away from the principal point. A bend is lens distortion that the \
                 model does not describe.",
            )
            .alt("Radial reprojection error against the radius in the image.")
            .aspect(1.45),
    )
}
