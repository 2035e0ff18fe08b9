//! Differences of two calibrations: by distance, and over the image.

use depthcal_io::{CameraDifference, DepthDifference, ProjectionDifference};
use depthcal_statistics::quantile;
use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{AFTER, NEUTRAL, band, colour_bar, diverging, round_factor, rounded, sequential, short, shorts};
use crate::format::{number, p_equals};

const DIFFERS: &str = "#c43a57";
/// Colours of multiples of the standard deviation end here.
const MOST_DEVIATIONS: f64 = 6.0;
/// Length of a typical line of the projection's map, as a share of the image's width.
const LENGTH: f64 = 0.05;

/// Root mean square over the image against distance, with that of noise.
pub(crate) fn difference_by_distance(camera: &CameraDifference) -> Figure {
    let distances = || shorts(camera.depth.iter().map(|d| d.distance_mm));
    let colours: Value = camera.depth.iter().map(|d| json!(if d.size.differs { DIFFERS } else { AFTER })).collect();
    let mut data = vec![json!({
        "type": "scatter", "mode": "lines+markers", "name": "difference", "x": distances(),
        "y": shorts(camera.depth.iter().map(|d| d.size.rms)), "line": {"color": AFTER, "width": 2},
        "marker": {"color": colours, "size": 9}, "hovertemplate": "%{x:.0f} mm: %{y:.3~g} mm<extra>difference</extra>",
    })];
    if camera.depth.iter().any(|d| d.size.expected_rms.is_some()) {
        data.push(json!({
            "type": "scatter", "mode": "lines", "name": "by the uncertainties alone", "x": distances(),
            "y": shorts(camera.depth.iter().map(|d| d.size.expected_rms.unwrap_or(f64::NAN))),
            "line": {"color": NEUTRAL, "width": 2, "dash": "dash"},
            "hovertemplate": "%{x:.0f} mm: %{y:.3~g} mm<extra>by the uncertainties</extra>",
        }));
    }
    let ends = [camera.depth.first(), camera.depth.last()].map(|d| d.map_or(f64::NAN, |d| d.distance_mm));
    let shapes: Vec<Value> = camera
        .covered_by_both_mm()
        .map(|[near, far]| vec![band(ends[0], near.max(ends[0])), band(far.min(ends[1]), ends[1])])
        .unwrap_or_default();
    let layout = json!({
        "xaxis": {"title": {"text": "measured depth / mm"}, "range": [short(ends[0]), short(ends[1])]},
        "yaxis": {"title": {"text": "rms over the image / mm"}, "rangemode": "tozero"}, "shapes": shapes,
    });
    Figure::new("difference-by-distance", "Difference of corrected depth by distance", data, layout)
        .caption(
            "Red marks: larger than the uncertainties of both allow. Grey: outside the distances that the boards of both \
             calibrations cover.",
        )
        .alt("Root mean square of the difference of corrected depth against distance, beside that of noise.")
        .aspect(2.4)
}

/// Axes and grid of a map over the image.
fn map(camera: &CameraDifference) -> (Value, Value) {
    let data = json!({
        "type": "heatmap", "hoverongaps": false,
        "x": shorts((0..camera.columns).map(|i| camera.pixel(i)[0])),
        "y": shorts((0..camera.rows).map(|i| camera.pixel(i * camera.columns)[1])),
    });
    let (w, h) = (camera.width as f64, camera.height as f64);
    let layout = json!({
        "xaxis": {"title": {"text": "u / px"}, "range": [-0.5, w - 0.5], "constrain": "domain", "showgrid": false},
        "yaxis": {"title": {"text": "v / px"}, "range": [h - 0.5, -0.5], "scaleanchor": "x", "constrain": "domain",
                  "showgrid": false},
    });
    (data, layout)
}

fn rows(camera: &CameraDifference, cells: impl Iterator<Item = Option<f64>>) -> Value {
    let cells: Vec<Value> = cells.map(|cell| cell.map_or(Value::Null, short)).collect();
    cells.chunks(camera.columns).map(|row| json!(row)).collect()
}

/// A map over the image with one variant per distance.
fn figure(camera: &CameraDifference, [id, title]: [&str; 2], style: &Value, variants: Vec<Variant>) -> Figure {
    let (mut data, layout) = map(camera);
    for (key, value) in style.as_object().into_iter().flatten() {
        data[key] = value.clone();
    }
    for (key, value) in variants.first().and_then(|v| v.trace.as_object()).into_iter().flatten() {
        data[key] = value.clone();
    }
    let mut figure = Figure::new(id, title, vec![data], layout).alt(format!("{title}: a map over the image."));
    figure.variants = if variants.len() > 1 { variants } else { Vec::new() };
    figure.aspect(camera.width as f64 / camera.height as f64 * 1.02)
}

/// Difference of corrected depth, and the same in standard deviations, at every distance.
pub(crate) fn depth_difference_maps(camera: &CameraDifference) -> Vec<Figure> {
    let label = |d: &DepthDifference| format!("{} mm", number(d.distance_mm));
    let note = |d: &DepthDifference| {
        let noise =
            d.size.expected_rms.map_or_else(String::new, |rms| format!(", by the uncertainties {} mm", number(rms)));
        let p = d.size.p_value.map_or_else(String::new, |p| format!("; {}", p_equals(p)));
        format!("{} mm rms{noise}{p}.", number(d.size.rms))
    };
    let in_mm = camera.depth.iter().map(|d| {
        let limit = quantile(d.difference_mm.iter().flatten().map(|v| v.abs()), 0.98).max(1e-3);
        let z = rows(camera, d.difference_mm.iter().copied());
        Variant { label: label(d), note: note(d), trace: json!({"z": z, "zmin": short(-limit), "zmax": short(limit)}) }
    });
    let style = json!({"colorscale": diverging(), "colorbar": colour_bar("mm"),
                       "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:+.3~g} mm<extra></extra>"});
    let caption = "Second minus first: orange where the second has the wall farther away, blue where nearer.";
    let mut figures = vec![
        figure(camera, ["depth-difference", "Difference of corrected depth"], &style, in_mm.collect()).caption(caption),
    ];
    if camera.depth.iter().any(|d| d.size.expected_rms.is_some()) {
        let deviations = camera.depth.iter().map(|d| {
            let ratio =
                |(value, std): (&Option<f64>, &Option<f64>)| Some((*value)? / (*std)?).filter(|r| r.is_finite());
            let z = rows(camera, d.difference_mm.iter().zip(&d.std_dev_mm).map(ratio));
            Variant { label: label(d), note: note(d), trace: json!({ "z": z }) }
        });
        let style = json!({"colorscale": diverging(), "colorbar": colour_bar("σ"), "zmin": -MOST_DEVIATIONS,
                           "zmax": MOST_DEVIATIONS,
                           "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:+.2~g} standard deviations<extra></extra>"});
        let caption = "The same in standard deviations of both calibrations together. Neighbouring cells vary together: few \
                       parameters move them all.";
        let title = "In standard deviations";
        figures.push(figure(camera, ["depth-deviations", title], &style, deviations.collect()).caption(caption));
    }
    figures
}

/// Length and direction of the difference of projection, and its standard deviation.
pub(crate) fn projection_maps(camera: &CameraDifference) -> Vec<Figure> {
    let label = |p: &ProjectionDifference| p.distance_mm.map_or_else(String::new, |mm| format!("{} mm", number(mm)));
    let length = |(du, dv): (&Option<f64>, &Option<f64>)| Some((*du)?.hypot((*dv)?));
    let lengths = camera.projection.iter().map(|p| {
        let most = quantile(p.du_px.iter().zip(&p.dv_px).filter_map(length), 0.95).max(1e-6);
        let z = rows(camera, p.du_px.iter().zip(&p.dv_px).map(length));
        let trace = json!({ "z": z, "zmax": short(most) });
        Variant { label: label(p), note: format!("{} px rms.", number(p.size.rms)), trace }
    });
    let style = json!({"colorscale": sequential(), "colorbar": colour_bar("px"), "zmin": 0,
                       "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:.3~g} px<extra></extra>"});
    let mut first = figure(camera, ["projection-difference", "Difference of projection"], &style, lengths.collect());
    let rotation = camera.projection.first().map_or([f64::NAN; 3], |p| p.rotation_rad);
    let angle = 1e3 * rotation.iter().map(|r| r * r).sum::<f64>().sqrt();
    let mut caption = format!(
        "Length, after a rotation of {} mrad was removed; 5 % of the cells are beyond the colours.",
        number(angle)
    );
    if let [p] = camera.projection.as_slice() {
        let (lines, factor) = lines(camera, p);
        caption += &format!(" Lines show its direction, enlarged {} ×.", number(factor));
        first.data.push(lines);
    }
    let mut figures = vec![first.caption(caption)];
    if camera.projection.iter().any(|p| p.size.expected_rms.is_some()) {
        let std_devs = camera.projection.iter().map(|p| Variant {
            label: label(p),
            note: format!("{} px rms.", number(p.size.rms)),
            trace: json!({"z": rows(camera, p.std_dev_px.iter().copied())}),
        });
        let title = "Its standard deviation";
        figures.push(
            figure(camera, ["projection-uncertainty", title], &style, std_devs.collect())
                .caption("Of both calibrations together, with the rotation removed likewise."),
        );
    }
    figures
}

/// A line in every cell along the difference, and by how much they are enlarged: 1, 2 or 5 times a power of ten.
fn lines(camera: &CameraDifference, p: &ProjectionDifference) -> (Value, f64) {
    let cells = || {
        let both = p.du_px.iter().zip(&p.dv_px).enumerate();
        both.filter_map(|(cell, (du, dv))| Some((camera.pixel(cell), [(*du)?, (*dv)?])))
    };
    let typical = quantile(cells().map(|(_, d)| d[0].hypot(d[1])), 0.9).max(1e-9);
    let factor = round_factor(LENGTH * camera.width as f64 / typical);
    let along = |axis: usize| -> Value {
        cells()
            .flat_map(|(pixel, d)| [rounded(pixel[axis], 1), rounded(pixel[axis] + factor * d[axis], 1), Value::Null])
            .collect()
    };
    let lines = json!({
        "type": "scatter", "mode": "lines", "x": along(0), "y": along(1), "hoverinfo": "skip", "showlegend": false,
        "line": {"color": "#ffffff", "width": 1.2},
    });
    (lines, factor)
}
