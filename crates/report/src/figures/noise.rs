//! The fitted law of depth noise and the scatter of each frame.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, NEUTRAL, plain, short, shorts};
use crate::format::number;
use crate::input::ReportCamera;
use crate::pool::Pool;
use depthcal_calibration::observe::noise::clipped_sigma;
use depthcal_statistics::median;

/// Fewest pixels of a frame in the figure.
const FEWEST: usize = 30;

/// Scatter of each frame's pixels about its own median against the distance; `None` without depth noise.
pub(crate) fn noise(camera: &ReportCamera<'_>) -> Option<Figure> {
    let c = camera.calibrated.filter(|c| c.with_depth)?;
    let pool = Pool::of(camera, |_| true);
    let frames: Vec<(String, f64, f64)> = pool
        .frames
        .iter()
        .filter_map(|f| {
            let pixels: Vec<_> = f.frame.pixels.iter().filter(|p| p.is_usable()).collect();
            if pixels.len() < FEWEST {
                return None;
            }
            let mut values: Vec<f64> = pixels.iter().map(|p| p.after_mm).collect();
            let centre = median(&mut values);
            values.iter_mut().for_each(|v| *v -= centre);
            let z = pixels.iter().map(|p| p.board_depth_mm).sum::<f64>() / pixels.len() as f64;
            Some((plain(&f.frame.name), z, clipped_sigma(&values)))
        })
        .collect();
    let ends = frames.iter().fold([f64::INFINITY, 0.0_f64], |e, f| [e[0].min(f.1), e[1].max(f.1)]);
    if !(ends[1] > ends[0]) {
        return None;
    }
    let z: Vec<f64> = (0..40).map(|i| ends[0] + (ends[1] - ends[0]) * f64::from(i) / 39.0).collect();
    let law = json!({
        "type": "scatter", "mode": "lines", "name": "noise law", "x": shorts(z.iter().copied()),
        "y": shorts(z.iter().map(|z| c.noise.depth.sigma(1.0 / z) * z * z)), "line": {"color": AFTER, "width": 2},
        "hovertemplate": "%{x:.0f} mm: %{y:.3~g} mm<extra>noise law</extra>",
    });
    let measured = json!({
        "type": "scatter", "mode": "markers", "name": "frames",
        "x": frames.iter().map(|f| short(f.1)).collect::<Value>(), "y": frames.iter().map(|f|
         short(f.2)).collect::<Value>(),
        "text": frames.iter().map(|f| f.0.clone()).collect::<Value>(),
        "marker": {"color": NEUTRAL, "size": 7},
        "hovertemplate": "frame %{text}: %{y:.3~g} mm at %{x:.0f} mm<extra></extra>",
    });
    let layout = json!({
        "xaxis": {"title": {"text": "distance / mm"}},
        "yaxis": {"title": {"text": "noise / mm"}, "rangemode": "tozero"},
    });
    let noise_mm = |z: f64| number(c.noise.depth.sigma(1.0 / z) * z * z);
    let told = format!(
        "{} mm at {} mm and {} mm at {} mm",
        noise_mm(ends[0]),
        number(ends[0]),
        noise_mm(ends[1]),
        number(ends[1])
    );
    Some(
        Figure::new("noise", "Noise of depth", vec![measured, law], layout)
            .caption(format!(
                "Standard deviation of a depth pixel: the fitted law ({told}), and the scatter of each frame about its median. \
                 Frames far above the law have systematic errors."
            ))
            .alt(format!("Noise of depth against distance: {told}."))
            .aspect(1.45),
    )
}
