//! Models compared: their errors with intervals, the captures that they need, and what the best one does to depth.

use depthcal_io::{Comparison, Errors, ModelComparison};
use serde_json::{Value, json};

use super::{AFTER, Figure, NEUTRAL, Variant, colour_bar, diverging, plain, rounded, short, shorts, whiskers};
use crate::html::{count, fixed, number};
use crate::statistics::quantile;
use crate::uncertainty::{distances, typical};
use depthcal_calibration::calibrate::Calibrated;

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
pub(crate) fn model_ranking(c: &Comparison) -> Figure {
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
                note: format!("{kind}, mm, on data that the fits did not see; whiskers: 95 % intervals."),
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
    data["y"] = models.iter().map(|m| plain(&m.model)).collect();
    data["textposition"] = json!("inside");
    data["insidetextanchor"] = json!("start");
    data["textfont"] = json!({"color": "#ffffff"});
    data["marker"] =
        json!({"color": models.iter().map(|m| if m.really_worse { NEUTRAL } else { AFTER }).collect::<Value>()});
    data["hovertemplate"] = json!("%{y}: %{x:.3~g} mm<extra></extra>");
    let layout = json!({
        "yaxis": {"type": "category", "autorange": "reversed", "dtick": 1}, "showlegend": false,
        "xaxis": {"title": {"text": "error on data that the fits did not see / mm"}, "rangemode": "tozero"},
    });
    let best = models.first().map_or("–", |m| m.model.as_str());
    let mut figure = Figure::new("ranking", "Depth models, best dot error first", vec![data], layout)
        .caption("Blue: these frames cannot tell the model from the best one; grey: really worse, with the number of models \
                  allowed for. Differences are known better than the whiskers suggest, since all models see the same frames.")
        .alt(format!("Ranking of {}; the best is {best}.", count(models.len(), "model")))
        .aspect(2.6);
    figure.variants = variants;
    figure
}

/// What a bar says of itself: nothing where it is too short to hold a number.
fn bar_text(error: Option<&depthcal_io::Interval>, longest: f64) -> String {
    const SHORTEST: f64 = 0.08;
    error.map_or_else(|| "–".to_owned(), |i| if i.mean < SHORTEST * longest { String::new() } else { fixed(i.mean, 2) })
}

/// Reasons of failed fits that a caption has room for; the tables have all.
const REASONS: usize = 3;

/// Errors against the number of frames in the fit.
pub(crate) fn learning_curve(c: &Comparison) -> Figure {
    let mut models: Vec<&str> = Vec::new();
    for point in &c.learning_curve {
        if !models.contains(&point.model.as_str()) {
            models.push(&point.model);
        }
    }
    let symbols = ["circle", "square", "diamond", "cross", "x", "triangle-up", "triangle-down", "star", "pentagon"];
    let colours = ["#1f86c7", "#d9730d", "#a05fb4", "#2a9d6f", "#808793", "#c43a57", "#8a6d1b", "#2b59a8", "#5f9ea0"];
    let points = |model: &str| c.learning_curve.iter().filter(|p| p.model == model).collect::<Vec<_>>();
    let of = kinds::<Option<f64>>()[0].1;
    let mut data = Vec::new();
    for (i, model) in models.iter().enumerate() {
        let list = points(model);
        data.push(json!({
            "type": "scatter", "mode": "lines+markers", "name": plain(model),
            "x": list.iter().map(|p| p.frames).collect::<Value>(),
            "y": list.iter().map(|p| of(&p.held_out).map_or(Value::Null, short)).collect::<Value>(),
            "line": {"color": colours[i % colours.len()], "width": 2},
            "marker": {"size": 7, "symbol": symbols[i % symbols.len()], "color": colours[i % colours.len()]},
            "hovertemplate": "%{x} frames: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
        }));
    }
    let values = || c.learning_curve.iter().filter_map(|p| of(&p.held_out));
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
        .map(|p| format!("{} with {}: {}", p.model, count(p.frames, "frame"), p.reasons.join("; ")))
        .collect();
    reasons.truncate(REASONS);
    let failures = match failed {
        0 => String::new(),
        n => format!(" {} failed and are left out ({}).", count(n, "fit"), plain(&reasons.join(". "))),
    };
    Figure::new("learning-curve", "Dot error against the number of frames", data, layout)
        .caption(format!("Mean over fits to frames drawn at random, the same for all models.{failures}"))
        .alt(format!("Dot error of {} against the number of frames in the fit.", count(models.len(), "model")))
        .aspect(2.4)
}

/// Columns of the correction map.
const COLUMNS: usize = 33;
/// A cell is supported where a sample lies within this many cells …
const REACH: f64 = 1.5;
/// … and this share of the distance.
const NEAR: f64 = 0.2;

/// What a model does to a flat wall at one distance, where frames had depth.
struct WallMap {
    distance_mm: f64,
    /// Corrected less measured depth of every cell, mm; `None` where no frame had depth.
    cells: Vec<Option<f64>>,
    /// The same less its plane over the image in inverse depth, which a projective D could do as well.
    beyond: Vec<Option<f64>>,
}

/// The grid of the maps over the image.
struct Grid {
    width: f64,
    height: f64,
    rows: usize,
}

impl Grid {
    fn pixel(&self, i: usize) -> [f64; 2] {
        let at = |k: usize, n: usize, size: f64| size * k as f64 / (n - 1) as f64;
        [at(i % COLUMNS, COLUMNS, self.width), at(i / COLUMNS, self.rows, self.height)]
    }

    /// Cells that samples at about a distance reach.
    fn supported(&self, samples: &[([f64; 2], f64)], distance_mm: f64) -> Vec<bool> {
        let mut supported = vec![false; COLUMNS * self.rows];
        let span = |x: f64, n: usize| {
            ((x - REACH).ceil().max(0.0) as usize)..((x + REACH).floor().max(0.0) as usize + 1).min(n)
        };
        for (p, _) in samples.iter().filter(|s| (s.1 / distance_mm - 1.0).abs() < NEAR) {
            let (u, v) = (p[0] / self.width * (COLUMNS - 1) as f64, p[1] / self.height * (self.rows - 1) as f64);
            for row in span(v, self.rows) {
                span(u, COLUMNS).for_each(|column| supported[row * COLUMNS + column] = true);
            }
        }
        supported
    }
}

fn wall_map(c: &Calibrated, grid: &Grid, samples: &[([f64; 2], f64)], distance_mm: f64) -> WallMap {
    let base = typical(c, [0.0; 2]);
    let rho = 1.0 / distance_mm;
    // Ray and change of inverse depth.
    let corrected: Vec<Option<([f64; 2], f64)>> = grid
        .supported(samples, distance_mm)
        .iter()
        .enumerate()
        .map(|(i, seen)| {
            let context = depthcal_model::Context { pixel: grid.pixel(i), ..base };
            c.camera
                .correct(&context, 1.0, rho)
                .ok()
                .filter(|r| *seen && r.1.is_finite())
                .map(|(ray, r)| (ray, r - rho))
        })
        .collect();
    let (mut normal, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
    for ([x, y], change) in corrected.iter().flatten() {
        let row = nalgebra::Vector3::new(*x, *y, 1.0);
        normal += row * row.transpose();
        right += row * *change;
    }
    let plane = normal.try_inverse().map_or_else(nalgebra::Vector3::zeros, |inverse| inverse * right);
    let depth = |change: f64| 1.0 / (rho + change) - distance_mm;
    let cells = corrected.iter().map(|c| c.map(|(_, change)| depth(change))).collect();
    let beyond = corrected
        .iter()
        .map(|c| c.map(|([x, y], change)| depth(change - plane.dot(&nalgebra::Vector3::new(x, y, 1.0)))))
        .collect();
    WallMap { distance_mm, cells, beyond }
}

/// What the model does to flat walls at three distances, and what of it no projective D does; empty without depth model.
pub(crate) fn correction_maps(c: &Calibrated) -> Vec<Figure> {
    let at = distances(c);
    if !c.with_depth || at.is_empty() {
        return Vec::new();
    }
    let (width, height) = (c.camera.width as f64 - 1.0, c.camera.height as f64 - 1.0);
    let grid = Grid { width, height, rows: ((COLUMNS as f64 * height / width).round() as usize).max(2) };
    let samples: Vec<([f64; 2], f64)> =
        c.capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| (s.context.pixel, s.depth_mm))).collect();
    let maps = [0.05, 0.5, 0.95].map(|q| wall_map(c, &grid, &samples, quantile(at.iter().copied(), q)));
    let figure = |id: &str, title: String, caption: &str, of: fn(&WallMap) -> &Vec<Option<f64>>| {
        let all = maps.iter().flat_map(|m| of(m).iter().flatten().map(|v| v.abs()));
        let limit = quantile(all, 0.98).max(1e-3);
        let variants = maps.iter().map(|m| {
            let at = |q: f64| number(quantile(of(m).iter().flatten().copied(), q));
            let share = of(m).iter().flatten().count() as f64 / of(m).len() as f64;
            let cell = |v: &Option<f64>| v.map_or(Value::Null, |v| rounded(v, 3));
            Variant {
                label: format!("{} mm", number(m.distance_mm)),
                note: format!(
                    "{} to {} mm where frames had depth within 20 % of this distance: {} % of the image.",
                    at(0.02),
                    at(0.98),
                    fixed(100.0 * share, 0)
                ),
                trace: json!({"z": of(m).chunks(COLUMNS).map(|r| r.iter().map(cell).collect::<Value>()).collect::<Value>()}),
            }
        });
        let variants: Vec<Variant> = variants.collect();
        let data = json!({
            "type": "heatmap", "x": shorts((0..COLUMNS).map(|i| grid.pixel(i)[0])),
            "y": shorts((0..grid.rows).map(|r| grid.pixel(r * COLUMNS)[1])),
            "zmin": -limit, "zmax": limit, "colorscale": diverging(), "colorbar": colour_bar("mm"), "hoverongaps": false,
            "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:+.3~g} mm<extra></extra>",
        });
        let layout = json!({
            "xaxis": {"title": {"text": "u / px"}, "constrain": "domain", "showgrid": false, "range": [0, width]},
            "yaxis": {"title": {"text": "v / px"}, "scaleanchor": "x", "constrain": "domain", "showgrid": false,
                      "range": [height, 0]},
        });
        let alt = format!("{title}: a map over the image.");
        let mut figure = Figure::new(id, title, vec![data], layout).caption(caption).alt(alt).aspect(1.3);
        figure.variants = variants;
        figure
    };
    vec![
        figure(
            "correction-map",
            format!("Correction by {}", c.model),
            "Corrected less measured depth of a flat wall at the chosen distance, near, middle or far of the fitted boards. \
             Empty: no frame had depth there at about this distance, and the model extrapolates.",
            |m| &m.cells,
        ),
        figure(
            "beyond-plane",
            "What of it no D can do".to_owned(),
            "The same without its plane in inverse depth, on a scale of its own: what the model has beyond a projective D at \
             this distance.",
            |m| &m.beyond,
        ),
    ]
}
