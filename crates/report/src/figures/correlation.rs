//! Correlations between the parameters.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{colour_bar, diverging, rounded};
use crate::format::fixed;
use depthcal_calibration::calibrate::CalibratedCamera;

/// Most parameters whose matrix is readable.
const MOST: usize = 40;

/// The correlation matrix; `None` without covariance or with too many parameters.
pub(crate) fn correlation(c: &CalibratedCamera) -> Option<Figure> {
    let covariance = c.covariance.as_ref()?;
    let short: Vec<&str> = c.camera.blocks().iter().flat_map(|b| b.parameters().iter().map(|p| &*p.name)).collect();
    let pieces: Vec<&'static str> =
        c.camera.blocks().iter().flat_map(|b| b.parameters().iter().map(|_| b.name())).collect();
    // Two pieces may have a parameter of the same name.
    let name = |i: usize| match short.iter().filter(|s| **s == short[i]).count() {
        1 => short[i].to_owned(),
        _ => format!("{}.{}", pieces[i], short[i]),
    };
    let names: Vec<String> = (0..short.len()).map(name).collect();
    let free: Vec<usize> = (0..names.len()).filter(|i| covariance[(*i, *i)] > 0.0).collect();
    if free.len() < 2 || free.len() > MOST {
        return None;
    }
    let r = |i: usize, j: usize| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
    let mut strongest = (0.0_f64, free[0], free[1]);
    for (a, i) in free.iter().enumerate() {
        for j in &free[..a] {
            if r(*i, *j).abs() > strongest.0.abs() {
                strongest = (r(*i, *j), *j, *i);
            }
        }
    }
    let labels: Value = free.iter().map(|i| names[*i].clone()).collect();
    let z: Value = free.iter().map(|i| free.iter().map(|j| rounded(r(*i, *j), 2)).collect::<Value>()).collect();
    let data = json!({
        "type": "heatmap", "x": labels, "y": labels, "z": z, "zmin": -1, "zmax": 1, "colorscale": diverging(),
        "colorbar": colour_bar("r"), "hovertemplate": "%{y}, %{x}: %{z}<extra></extra>",
    });
    let layout = json!({
        "xaxis": {"type": "category", "tickangle": -45, "showgrid": false},
        "yaxis": {"type": "category", "autorange": "reversed", "scaleanchor": "x", "constrain": "domain",
                  "showgrid": false},
    });
    let told = format!("{} and {} ({})", names[strongest.1], names[strongest.2], fixed(strongest.0, 2));
    Some(
        Figure::new("correlation", "Correlations of the parameters", vec![data], layout)
            .caption(format!(
                "Strongest: {told}. Of a pair near ± 1 only a combination is well determined, not each by itself."
            ))
            .alt(format!("Correlation matrix of the parameters. Strongest: {told}."))
            .aspect(1.2),
    )
}
