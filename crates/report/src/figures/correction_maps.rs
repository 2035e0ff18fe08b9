//! The change of a flat wall by a depth model, as maps over the image.

use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{colour_bar, diverging, rounded, shorts};
use crate::format::{fixed, number};
use crate::parameters::model_words;
use crate::uncertainty::{distances, typical};
use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_statistics::quantile;

/// Columns of the correction map.
const COLUMNS: usize = 33;
/// A cell is supported where a sample lies within this many cells …
const REACH: f64 = 1.5;
/// … and this share of the distance.
const NEAR: f64 = 0.2;

/// The correction of a flat wall at one distance, where frames had depth.
struct WallMap {
    distance_mm: f64,
    /// Corrected minus measured depth of every cell, mm; `None` where no frame had depth.
    cells: Vec<Option<f64>>,
    /// The correction minus its best plane in inverse depth, which a projective D describes as well.
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
        let coordinate = |k: usize, n: usize, size: f64| size * k as f64 / (n - 1) as f64;
        [coordinate(i % COLUMNS, COLUMNS, self.width), coordinate(i / COLUMNS, self.rows, self.height)]
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

fn wall_map(c: &CalibratedCamera, grid: &Grid, samples: &[([f64; 2], f64)], distance_mm: f64) -> WallMap {
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

/// Maps of the correction at three distances, and of its part beyond a projective D; empty without a depth model.
pub(crate) fn correction_maps(c: &CalibratedCamera) -> Vec<Figure> {
    let depths_mm = distances(c);
    if !c.with_depth || depths_mm.is_empty() {
        return Vec::new();
    }
    let (width, height) = (c.camera.width as f64 - 1.0, c.camera.height as f64 - 1.0);
    let grid = Grid { width, height, rows: ((COLUMNS as f64 * height / width).round() as usize).max(2) };
    let samples: Vec<([f64; 2], f64)> =
        c.capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| (s.context.pixel, s.depth_mm))).collect();
    let maps = [0.05, 0.5, 0.95].map(|q| wall_map(c, &grid, &samples, quantile(depths_mm.iter().copied(), q)));
    let figure = |id: &str, title: String, caption: &str, of: fn(&WallMap) -> &Vec<Option<f64>>| {
        let all = maps.iter().flat_map(|m| of(m).iter().flatten().map(|v| v.abs()));
        let limit = quantile(all, 0.98).max(1e-3);
        let variants = maps.iter().map(|m| {
            let change_mm = |q: f64| number(quantile(of(m).iter().flatten().copied(), q));
            let share = of(m).iter().flatten().count() as f64 / of(m).len() as f64;
            let cell = |v: &Option<f64>| v.map_or(Value::Null, |v| rounded(v, 3));
            Variant {
                label: format!("{} mm", number(m.distance_mm)),
                note: format!(
                    "{} to {} mm where frames had depth within 20 % of this distance: {} % of the image.",
                    change_mm(0.02),
                    change_mm(0.98),
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
            format!("Correction by {}", model_words(c)),
            "Corrected minus measured depth of a flat wall at the chosen distance: near, median or far of the fitted \
             boards. Empty: no frame had depth there at about this distance, so that the model extrapolates.",
            |m| &m.cells,
        ),
        figure(
            "beyond-plane",
            "The part beyond a projective D".to_owned(),
            "The same minus its best plane in inverse depth, which a projective D describes as well. On a scale of its own.",
            |m| &m.beyond,
        ),
    ]
}
