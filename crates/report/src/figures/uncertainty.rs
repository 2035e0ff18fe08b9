//! Uncertainty of corrected depth.

use serde_json::{Value, json};

use super::figure::{Figure, Variant};
use super::plotly::{AFTER, NEUTRAL, band, colour_bar, map_axes, sequential, shorts};
use crate::format::number;
use crate::uncertainty::Uncertainty;
use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::judge::difference::projection_difference;
use depthcal_io::grid_pixel;
use depthcal_model::uncertainty::UncertainCamera;
use depthcal_statistics::quantile;

/// With more free parameters than this there is no map of projection, which would take seconds.
const MOST_PARAMETERS: usize = 80;

/// Standard deviation against the distance, at three places of the image, and the noise of one pixel.
pub(crate) fn uncertainty_curves(c: &CalibratedCamera, u: &Uncertainty) -> Figure {
    let places = [("middle of the image", "solid"), ("halfway to the corner", "dash"), ("corner", "dot")];
    let mut data: Vec<Value> = places
        .iter()
        .zip(&u.curves)
        .map(|((name, dash), curve)| {
            json!({
                "type": "scatter", "mode": "lines", "name": name, "x": shorts(u.curve_at.iter().copied()),
                "y": shorts(curve.iter().copied()), "line": {"color": AFTER, "dash": dash, "width": 2},
                "hovertemplate": "%{x:.0f} mm: %{y:.2~g} mm<extra>%{fullData.name}</extra>",
            })
        })
        .collect();
    let noise = |z: &f64| c.noise.depth.sigma(1.0 / z) * z * z;
    data.push(json!({
        "type": "scatter", "mode": "lines", "name": "noise of one pixel", "x": shorts(u.curve_at.iter().copied()),
        "y": shorts(u.curve_at.iter().map(noise)), "line": {"color": NEUTRAL, "width": 1.5, "dash": "dashdot"},
        "hovertemplate": "%{x:.0f} mm: %{y:.2~g} mm<extra>noise of one pixel</extra>",
    }));
    let [near, far] = u.covered;
    let ends = [u.curve_at.first().copied().unwrap_or(near), u.curve_at.last().copied().unwrap_or(far)];
    let layout = json!({
        "xaxis": {"title": {"text": "distance / mm"}, "range": [ends[0], ends[1]]},
        "yaxis": {"title": {"text": "standard deviation / mm"}, "type": "log", "dtick": "D2"},
        "shapes": [band(ends[0], near), band(far, ends[1])],
    });
    let std_dev = |curve: &[f64]| {
        let i = u.curve_at.iter().position(|z| *z >= u.distances[1]).unwrap_or(0);
        number(curve.get(i).copied().unwrap_or(f64::NAN))
    };
    let told = format!(
        "At {} mm: {} mm in the middle of the image, {} mm in its corner",
        number(u.distances[1]),
        std_dev(&u.curves[0]),
        std_dev(&u.curves[2])
    );
    Figure::new("uncertainty-curves", "Standard deviation of corrected depth", data, layout)
        .caption(format!(
            "Standard deviation of the correction itself, which is common to all frames and is not removed by averaging, and \
             the noise of a single pixel. Logarithmic scale. {told}. Grey: outside the distances of the fitted boards."
        ))
        .alt(format!("Standard deviation of corrected depth against distance. {told}."))
        .aspect(1.45)
}

/// Standard deviation over the image at three distances, with a picker.
pub(crate) fn uncertainty_map(c: &CalibratedCamera, u: &Uncertainty) -> Figure {
    let (w, h) = (c.camera.width as f64 - 1.0, c.camera.height as f64 - 1.0);
    let [columns, rows] = u.grid;
    let variants: Vec<Variant> = u
        .maps
        .iter()
        .zip(&u.distances)
        .map(|(map, z)| {
            let rows: Value = map.chunks(columns).map(|r| shorts(r.iter().copied())).collect();
            let (low, high) = (quantile(map.iter().copied(), 0.0), quantile(map.iter().copied(), 1.0));
            Variant {
                label: format!("{} mm", number(*z)),
                note: format!("Between {} and {} mm over the image.", number(low), number(high)),
                trace: json!({"z": rows}),
            }
        })
        .collect();
    let data = json!({
        "type": "heatmap", "x": shorts((0..columns).map(|i| w * i as f64 / (columns - 1) as f64)),
        "y": shorts((0..rows).map(|i| h * i as f64 / (rows - 1) as f64)), "zmin": 0,
        "colorscale": sequential(), "colorbar": colour_bar("mm"), "hoverongaps": false,
        "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:.2~g} mm<extra></extra>",
    });
    let layout = map_axes(["u / px", "v / px"]);
    let mut figure = Figure::new("uncertainty-map", "The same over the image", vec![data], layout)
        .caption(
            "Standard deviation of the correction for a flat wall at the chosen distance: near, median or far of the fitted \
             boards.",
        )
        .alt("Map of the standard deviation of corrected depth over the image.")
        .aspect(1.3);
    figure.variants = variants;
    figure
}

/// Columns of the map of projection.
const COLUMNS: usize = 17;

/// Standard deviation of the pixel that a ray is projected to, over the image; `None` without a covariance.
pub(crate) fn projection_uncertainty(c: &CalibratedCamera) -> Option<Figure> {
    let covariance = c.covariance.as_ref()?;
    let places: Vec<usize> = (0..covariance.nrows()).filter(|i| covariance[(*i, *i)] > 0.0).collect();
    if places.is_empty() || places.len() > MOST_PARAMETERS {
        return None;
    }
    let of_free = covariance.select_rows(&places).select_columns(&places);
    let size = [c.camera.width, c.camera.height];
    let rows = ((COLUMNS as f64 * size[1] as f64 / size[0] as f64).round() as usize).max(2);
    let pixels: Vec<[f64; 2]> = (0..COLUMNS * rows).map(|i| grid_pixel(size, [COLUMNS, rows], i)).collect();
    let distance = quantile(crate::uncertainty::distances(c), 0.5);
    let [uncertain, exact] =
        [UncertainCamera::new(c.camera.clone(), &places, &of_free), UncertainCamera::exact(c.camera.clone())];
    let std_devs = projection_difference([&uncertain, &exact], &pixels, distance).difference.std_devs::<2>();
    let values: Vec<f64> = std_devs.iter().map(|std| std.unwrap_or(f64::NAN)).collect();
    let valid = || values.iter().copied().filter(|v| v.is_finite());
    let [low, middle, high] = [0.0, 0.5, 0.95].map(|q| quantile(valid(), q));
    let z: Value = values.chunks(COLUMNS).map(|row| shorts(row.iter().copied())).collect();
    let data = json!({
        "type": "heatmap", "x": shorts((0..COLUMNS).map(|i| pixels[i][0])),
        "y": shorts((0..rows).map(|i| pixels[i * COLUMNS][1])), "z": z, "zmin": 0, "zmax": high,
        "colorscale": sequential(), "colorbar": colour_bar("px"), "hoverongaps": false,
        "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:.2~g} px<extra></extra>",
    });
    let layout = map_axes(["u / px", "v / px"]);
    let told = format!(
        "{} px at least, {} px in the middle of all cells; 5 % are above {} px",
        number(low),
        number(middle),
        number(high)
    );
    Some(
        Figure::new("projection-std", "Uncertainty of projection", vec![data], layout)
            .caption(format!(
                "Standard deviation of the pixel to which the camera projects a ray, both coordinates together, less the rotation that \
                 poses take up. {told}."
            ))
            .alt(format!("Map of the standard deviation of projection over the image. {told}."))
            .aspect(size[0] as f64 / size[1] as f64 * 1.02),
    )
}
