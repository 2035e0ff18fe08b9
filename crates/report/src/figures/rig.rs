//! A rig in space, and transfer errors over the image and over distance.

use depthcal_calibration::judge::transfer::Transfer;
use depthcal_calibration::observe::PlacedCamera;
use depthcal_io::TransferError;
use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, NEUTRAL, OTHER, axis, plain, rounded, shorts};
use super::poses::frustum;
use crate::format::count;

/// Colours of cameras, repeated where there are more.
const COLOURS: [&str; 3] = [BEFORE, AFTER, OTHER];
/// Most markers of a map.
const MOST: usize = 2000;

/// Frusta of the cameras and outlines of the boards, in the frame of the rig.
pub(crate) fn rig_in_space(cameras: &[PlacedCamera], rig_from_board: &[Isometry3<f64>], points: &[[f64; 2]]) -> Figure {
    let start = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let b = points.iter().fold(start, |b, p| [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])]);
    let corners = [[b[0], b[1]], [b[2], b[1]], [b[2], b[3]], [b[0], b[3]], [b[0], b[1]]];
    let (mut x, mut y, mut z, mut far) = (Vec::new(), Vec::new(), Vec::new(), 0.0_f64);
    for pose in rig_from_board {
        for c in corners {
            let p = pose * Point3::new(c[0], c[1], 0.0);
            far = far.max(p.z);
            x.push(rounded(p.x, 0));
            y.push(rounded(p.z, 0));
            z.push(rounded(-p.y, 0));
        }
        [&mut x, &mut y, &mut z].into_iter().for_each(|list| list.push(Value::Null));
    }
    let mut data = vec![json!({
        "type": "scatter3d", "mode": "lines", "name": count(rig_from_board.len(), "board"), "x": x, "y": y, "z": z,
        "connectgaps": false, "line": {"color": NEUTRAL, "width": 3}, "hoverinfo": "name",
    })];
    for (number, placed) in cameras.iter().enumerate() {
        let (name, colour) = (plain(&placed.name), COLOURS[number % COLOURS.len()]);
        data.push(frustum(&placed.camera, |p| placed.in_rig(p), 0.2 * far.max(100.0), [&name, colour], 1));
    }
    let side = |title: &str| json!({"title": {"text": title}, "nticks": 6});
    let layout = json!({
        "scene": {
            "aspectmode": "data", "xaxis": side("x / mm"), "yaxis": side("distance / mm"), "zaxis": side("up / mm"),
            "camera": {"eye": {"x": -1.05, "y": -1.25, "z": 0.65}},
        },
        "margin": {"l": 0, "r": 0, "t": 24, "b": 0},
    });
    Figure::new("rig-in-space", "Cameras and boards in the frame of the rig", data, layout)
        .caption("Pyramids are the cameras' fields of view. Drag to turn.")
        .alt(format!("{} and the boards that they saw, drawn in space.", count(cameras.len(), "camera")))
        .aspect(1.35)
}

/// Transfer errors over the distance of the markers, one line per pair.
pub(crate) fn transfer_by_distance(records: &[TransferError]) -> Figure {
    let line = |(number, t): (usize, &TransferError)| {
        json!({
            "type": "scatter", "mode": "lines+markers", "name": plain(&format!("{} to {}, {}", t.from, t.to, t.dataset)),
            "x": shorts(t.by_distance.iter().map(|d| d.distance_mm)), "y": shorts(t.by_distance.iter().map(|d| d.rms_mm)),
            "line": {"color": COLOURS[number % COLOURS.len()]},
        })
    };
    let data = records.iter().enumerate().map(line).collect();
    let layout = json!({"xaxis": axis("distance / mm"), "yaxis": axis("transfer error / mm rms")});
    Figure::new("transfer-distance", "Transfer errors over distance", data, layout)
        .caption("Distance between a marker's point by corrected depth and the line on which the other camera sees it.")
        .alt("Lines of the transfer error over distance.")
        .aspect(2.0)
}

/// Transfer errors over the image of the camera in which they are compared.
pub(crate) fn transfer_over_image(number: usize, transfer: &Transfer) -> Figure {
    let step = transfer.points.len().div_ceil(MOST).max(1);
    let some = || transfer.points.iter().step_by(step);
    let size: Vec<f64> = some().map(|p| p.error_px[0].hypot(p.error_px[1])).collect();
    let mut sorted = size.clone();
    sorted.sort_by(f64::total_cmp);
    let most = sorted.get(sorted.len() * 19 / 20).copied().unwrap_or(1.0);
    let data = vec![json!({
        "type": "scatter", "mode": "markers", "x": shorts(some().map(|p| p.pixel[0])), "y": shorts(some().map(|p| p.pixel[1])),
        "marker": {"size": 5, "color": shorts(size), "cmin": 0, "cmax": most, "colorscale": "Viridis", "showscale": true,
                   "colorbar": {"title": {"text": "px"}, "thickness": 10}},
        "hovertemplate": "%{marker.color:.2f} px at (%{x:.0f}, %{y:.0f})<extra></extra>",
    })];
    let mut rows = axis("v / px");
    rows["autorange"] = json!("reversed");
    let layout = json!({"xaxis": axis("u / px"), "yaxis": rows});
    let title = format!("{} through its depth into {}", transfer.from, transfer.to);
    Figure::new(format!("transfer-image-{number}"), title, data, layout)
        .caption("Every dot is a marker where the second camera sees it; its colour is the distance of the transferred point.")
        .alt("Transfer errors of markers over the image.")
        .aspect(1.4)
}
