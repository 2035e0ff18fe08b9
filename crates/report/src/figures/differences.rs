//! Difference images of single frames, before and after, with a picker.

use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{colour_bar, diverging, map_axes, rounded};
use crate::format::{count, number};
use crate::input::ReportCamera;
use crate::input::ReportDiagnosis;
use crate::left_out::share;
use crate::pool::{Pool, Pooled};
use depthcal_calibration::judge::camera::EvaluatedFrame;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_statistics::{median, quantile};

/// Most cells of all frames together, which bounds the size of the file.
const CELLS: usize = 50_000;
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
        frame.pixels.iter().filter(|p| p.is_usable() && p.context.pixel.iter().all(|c| c.is_finite())).collect();
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
    let mut text = format!("{} at {} mm", count(f.frame.depth.pixels, "pixel"), number(z));
    if cos.is_finite() {
        text += &format!(", angle of incidence {}°", number(cos.clamp(-1.0, 1.0).acos().to_degrees()));
    }
    if let Some(rms) = record.depth_rms_mm {
        text += &format!(". Depth error {} → {} mm rms", number(rms.before), number(rms.after));
    }
    if f.frame.outliers > 0 {
        text += &format!("; {} of the board left out", share(Some(f.frame.outlier_share())));
    }
    text + "."
}

/// The traces and names of figures that share a picker.
struct Series<'a> {
    id: &'a str,
    title: &'a str,
    caption: &'a str,
    /// A frame's cells.
    rasters: Vec<Option<(Raster, bool)>>,
    /// Shares colours with the figures of the same group.
    group: usize,
}

fn as_measured(rasters: Vec<Option<(Raster, bool)>>) -> Series<'static> {
    Series {
        id: "difference-before",
        title: "As measured",
        caption: "Measured depth minus the board's depth. Holes are markers and missing depth.",
        rasters,
        group: 0,
    }
}

fn values(r: &(Raster, bool)) -> &[f64] {
    if r.1 { &r.0.after } else { &r.0.before }
}

fn figures(labels: &[(String, String)], series: Vec<Series<'_>>) -> Vec<Figure> {
    let limit = |group: usize| {
        let cells = || series.iter().filter(|s| s.group == group).flat_map(|s| s.rasters.iter().flatten());
        let size_mm = |after: bool, q: f64| {
            quantile(cells().filter(|r| r.1 == after).flat_map(|r| values(r).iter().map(|v| v.abs())), q)
        };
        let (before, after) = (size_mm(false, 0.98), size_mm(true, if group == 0 { 0.9 } else { 0.97 }));
        before.max(after).max(1e-3)
    };
    let limits: Vec<f64> = series.iter().map(|s| limit(s.group)).collect();
    let layout = map_axes(["u / px", "v / px"]);
    let build = |(s, limit): (Series<'_>, f64)| {
        let decimals = (2.0 - limit.log10().floor()).clamp(0.0, 4.0) as i32;
        let trace = |r: &Option<(Raster, bool)>| {
            let Some(r) = r else { return json!({"z": []}) };
            let rows = values(r).chunks(r.0.columns);
            let z: Value = rows.map(|row| row.iter().map(|v| rounded(*v, decimals)).collect::<Value>()).collect();
            json!({"x0": r.0.first[0], "dx": r.0.step, "y0": r.0.first[1], "dy": r.0.step, "z": z})
        };
        let data = json!({
            "type": "heatmap", "zmin": -limit, "zmax": limit, "colorscale": diverging(), "colorbar": colour_bar("mm"),
            "hoverongaps": false, "hovertemplate": "(%{x}, %{y}): %{z:+.3~g} mm<extra></extra>",
        });
        let mut figure = Figure::new(s.id, s.title, vec![data], layout.clone())
            .alt(format!("{}: map of the chosen frame's depth error.", s.title))
            .caption(s.caption)
            .aspect(1.3);
        let variants = labels.iter().zip(&s.rasters);
        figure.variants = variants
            .map(|((label, note), r)| Variant { label: label.clone(), note: note.clone(), trace: trace(r) })
            .collect();
        figure
    };
    series.into_iter().zip(limits).map(build).collect()
}

/// Two figures, before and after, with the same variants; empty without depth.
pub(crate) fn differences(camera: &ReportCamera<'_>) -> Vec<Figure> {
    let mut pool = Pool::of(camera, |_| true);
    // Held-out frames first: their errors are those to expect on new frames.
    pool.frames.sort_by_key(|f| f.role == crate::Role::Fitted);
    pool.frames.retain(|f| f.frame.pixels.iter().any(PixelError::is_usable));
    if pool.frames.is_empty() {
        return Vec::new();
    }
    let cells = (CELLS / pool.frames.len()).clamp(60, CELLS_PER_FRAME);
    let many = camera.evaluations.len() > 1 && {
        let first = camera.evaluations[0].evaluated.name.as_str();
        camera.evaluations.iter().any(|d| d.evaluated.name != first)
    };
    let labels: Vec<(String, String)> = pool.frames.iter().map(|f| (label(f, many), note(f))).collect();
    let side = |after: bool| pool.frames.iter().map(|f| Some((raster(f.frame, cells)?, after))).collect();
    let series = vec![
        as_measured(side(false)),
        Series {
            id: "difference-after",
            title: "Corrected",
            caption: "Corrected depth minus the board's depth, in the same colours.",
            rasters: side(true),
            group: 0,
        },
    ];
    figures(&labels, series)
}

/// Three figures of the held-out frames of a diagnosis: as measured, and under the declared and the last model.
pub(crate) fn differences_by_model(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> Vec<Figure> {
    let mut pool = Pool::last(camera);
    pool.frames.retain(|f| f.frame.pixels.iter().any(PixelError::is_usable));
    if pool.frames.is_empty() {
        return Vec::new();
    }
    let declared = |f: &Pooled<'_>| d.before.frames.iter().find(|b| b.name == f.frame.name);
    let rms = |f: &EvaluatedFrame| f.record().depth_rms_mm.map_or_else(|| "–".to_owned(), |r| number(r.after));
    let note = |f: &Pooled<'_>| {
        let before = declared(f)
            .map_or_else(String::new, |b| format!(" Declared model: {} mm, last model: {} mm.", rms(b), rms(f.frame)));
        note(f) + &before
    };
    let labels: Vec<(String, String)> = pool.frames.iter().map(|f| (f.frame.name.clone(), note(f))).collect();
    let cells = (CELLS / pool.frames.len()).clamp(60, CELLS_PER_FRAME);
    let rasters = |after: bool| pool.frames.iter().map(|f| Some((raster(f.frame, cells)?, after))).collect();
    let series = vec![
        as_measured(rasters(false)),
        Series {
            id: "difference-declared",
            title: "Corrected by the declared model",
            caption: "Corrected depth minus the board's depth, on a colour scale of its own.",
            rasters: pool.frames.iter().map(|f| Some((raster(declared(f)?, cells)?, true))).collect(),
            group: 1,
        },
        Series {
            id: "difference-after",
            title: "Corrected by the last model",
            caption: "The same after the added effects, in the same colours.",
            rasters: rasters(true),
            group: 1,
        },
    ];
    figures(&labels, series)
}
