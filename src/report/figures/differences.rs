//! Difference images of single frames, before and after, with a picker.

use serde_json::{Value, json};

use super::{Figure, Variant, colour_bar, diverging, rounded};
use crate::evaluate::{EvaluatedFrame, PixelError};
use crate::report::ReportInput;
use crate::report::html::{count, number};
use crate::report::pool::{Pool, Pooled, usable};
use crate::report::statistics::{median, quantile};

/// Cells of all frames together, which bounds the size of the file.
const CELLS: usize = 70_000;
/// Most cells of one frame.
const CELLS_PER_FRAME: usize = 2500;

/// A frame's pixels, averaged in square cells.
struct Raster {
    first: [f64; 2],
    step: f64,
    columns: usize,
    before: Vec<f64>,
    after: Vec<f64>,
}

fn raster(frame: &EvaluatedFrame, cells: usize) -> Option<Raster> {
    let pixels: Vec<&PixelError> =
        frame.pixels.iter().filter(|p| usable(p) && p.context.pixel.iter().all(|c| c.is_finite())).collect();
    let bounds = pixels.iter().fold([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY], |b, p| {
        let [u, v] = p.context.pixel;
        [b[0].min(u), b[1].min(v), b[2].max(u), b[3].max(v)]
    });
    if pixels.is_empty() {
        return None;
    }
    let (w, h) = (bounds[2] - bounds[0] + 1.0, bounds[3] - bounds[1] + 1.0);
    let step = (w * h / cells as f64).sqrt().ceil().max(1.0);
    let (columns, rows) = ((w / step).ceil() as usize, (h / step).ceil() as usize);
    let mut lists = vec![[Vec::new(), Vec::new()]; columns * rows];
    for p in pixels {
        let [u, v] = p.context.pixel;
        let cell = ((v - bounds[1]) / step) as usize * columns + ((u - bounds[0]) / step) as usize;
        lists[cell][0].push(p.before_mm);
        lists[cell][1].push(p.after_mm);
    }
    let medians = |i: usize, lists: &mut Vec<[Vec<f64>; 2]>| lists.iter_mut().map(|l| median(&mut l[i])).collect();
    let (before, after) = (medians(0, &mut lists), medians(1, &mut lists));
    let half = (step - 1.0) / 2.0;
    Some(Raster { first: [bounds[0] + half, bounds[1] + half], step, columns, before, after })
}

fn label(f: &Pooled<'_>, many: bool) -> String {
    let dataset = if many { format!("{} · ", f.dataset) } else { String::new() };
    format!("{dataset}{} ({})", f.frame.name, f.role.name())
}

fn note(f: &Pooled<'_>) -> String {
    let record = f.frame.record();
    let z = quantile(f.frame.pixels.iter().map(|p| p.board_depth_mm), 0.5);
    let cos = quantile(f.frame.pixels.iter().map(|p| p.cos_incidence), 0.5);
    let mut text = format!("{} at {} mm", count(f.frame.pixels.len(), "pixel"), number(z));
    if cos.is_finite() {
        text += &format!(", seen at {}°", number(cos.clamp(-1.0, 1.0).acos().to_degrees()));
    }
    if let Some(rms) = record.depth_rms_mm {
        text += &format!(". Depth error {} → {} mm rms", number(rms.before), number(rms.after));
    }
    text + "."
}

/// Two figures, before and after, with the same variants; empty without depth.
pub(in crate::report) fn differences(input: &ReportInput<'_>) -> Vec<Figure> {
    let mut pool = Pool::of(input, |_| true);
    // Frames that the fit did not see come first: they are what counts.
    pool.frames.sort_by_key(|f| f.role == crate::report::Role::Fitted);
    let with_depth = pool.frames.iter().filter(|f| f.frame.pixels.iter().any(usable)).count();
    if with_depth == 0 {
        return Vec::new();
    }
    let cells = (CELLS / with_depth).clamp(60, CELLS_PER_FRAME);
    let many = input.evaluations.len() > 1 && {
        let first = input.evaluations[0].evaluated.name.as_str();
        input.evaluations.iter().any(|d| d.evaluated.name != first)
    };
    let rasters: Vec<(&Pooled<'_>, Raster)> =
        pool.frames.iter().filter_map(|f| Some((f, raster(f.frame, cells)?))).collect();
    let limit = quantile(rasters.iter().flat_map(|r| r.1.before.iter().map(|v| v.abs())), 0.98)
        .max(quantile(rasters.iter().flat_map(|r| r.1.after.iter().map(|v| v.abs())), 0.9))
        .max(1e-3);
    let decimals = (2.0 - limit.log10().floor()).clamp(0.0, 4.0) as i32;
    let trace = |r: &Raster, values: &[f64]| {
        let rows = values.chunks(r.columns);
        let z: Value = rows.map(|row| row.iter().map(|v| rounded(*v, decimals)).collect::<Value>()).collect();
        json!({"x0": r.first[0], "dx": r.step, "y0": r.first[1], "dy": r.step, "z": z})
    };
    let figure = |id: &str, title: &str, after: bool| {
        let variants: Vec<Variant> = rasters
            .iter()
            .map(|(f, r)| Variant {
                label: label(f, many),
                note: note(f),
                trace: trace(r, if after { &r.after } else { &r.before }),
            })
            .collect();
        let data = json!({
            "type": "heatmap", "zmin": -limit, "zmax": limit, "colorscale": diverging(), "colorbar": colour_bar("mm"),
            "hoverongaps": false, "hovertemplate": "(%{x}, %{y}): %{z:+.3~g} mm<extra></extra>",
        });
        let layout = json!({
            "xaxis": {"title": {"text": "u / px"}, "constrain": "domain", "showgrid": false},
            "yaxis": {"title": {"text": "v / px"}, "autorange": "reversed", "scaleanchor": "x",
                      "constrain": "domain", "showgrid": false},
        });
        let mut figure = Figure::new(id, title, vec![data], layout)
            .alt(format!("{title}: map of the chosen frame's depth error."))
            .aspect(1.3);
        figure.variants = variants;
        figure
    };
    vec![
        figure("difference-before", "As measured", false)
            .caption("Measured depth minus the board's depth, pixel by pixel. Holes are markers and missing depth."),
        figure("difference-after", "Corrected", true)
            .caption("Corrected depth minus the board's depth, same frame, same colours."),
    ]
}
