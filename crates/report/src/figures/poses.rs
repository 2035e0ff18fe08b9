//! The boards in space.

use depthcal_model::Camera;
use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, NEUTRAL, OTHER, plain, rounded};
use crate::format::{count, number};
use crate::input::{ReportCamera, Role};
use crate::pool::Pool;

/// A frame's name and pose.
type Named = (String, Isometry3<f64>);

/// Corners of the board's rectangle of markers, mm.
fn outline(camera: &ReportCamera<'_>, pool: &Pool<'_>) -> Option<[[f64; 2]; 4]> {
    let points: Vec<[f64; 2]> = match camera.calibrated {
        Some(c) => c.capture.target.points(),
        None => pool.pixels().map(|p| p.board).collect(),
    };
    let finite = points.iter().filter(|p| p[0].is_finite() && p[1].is_finite());
    let start = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let b = finite.fold(start, |b, p| [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])]);
    (b[0] < b[2] && b[1] < b[3]).then_some([[b[0], b[1]], [b[2], b[1]], [b[2], b[3]], [b[0], b[3]]])
}

fn board(pose: &Isometry3<f64>, corners: &[[f64; 2]; 4]) -> Vec<[f64; 3]> {
    let in_space = |c: &[f64; 2]| {
        let p = pose * Point3::new(c[0], c[1], 0.0);
        [p.x, p.y, p.z]
    };
    corners.iter().chain(std::iter::once(&corners[0])).map(in_space).collect()
}

/// Boards and camera; `None` without any pose.
pub(crate) fn poses(camera: &ReportCamera<'_>) -> Option<Figure> {
    let pool = Pool::of(camera, |_| true);
    let corners = outline(camera, &pool)?;
    let mut groups: Vec<(Role, Vec<Named>)> = Vec::new();
    let mut add = |role: Role, name: &str, pose: Isometry3<f64>| match groups.iter_mut().find(|g| g.0 == role) {
        Some(g) => g.1.push((name.to_owned(), pose)),
        None => groups.push((role, vec![(name.to_owned(), pose)])),
    };
    pool.frames.iter().for_each(|f| add(f.role, &f.frame.name, f.frame.camera_from_board));
    if let (true, Some(c)) = (pool.frames.is_empty(), camera.calibrated) {
        c.capture.frames.iter().for_each(|f| add(Role::Fitted, &f.name, f.camera_from_board));
    }
    if groups.is_empty() {
        return None;
    }
    let mut data = Vec::new();
    let mut reach = [f64::INFINITY, 0.0_f64];
    for (role, boards) in &groups {
        // The plot's axes: x to the right, distance away from the viewer, −y upwards.
        let (mut x, mut y, mut z, mut text) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (name, pose) in boards {
            for p in board(pose, &corners) {
                x.push(rounded(p[0], 0));
                y.push(rounded(p[2], 0));
                z.push(rounded(-p[1], 0));
                text.push(json!(plain(name)));
                reach = [reach[0].min(p[2]), reach[1].max(p[2])];
            }
            [&mut x, &mut y, &mut z, &mut text].into_iter().for_each(|l| l.push(Value::Null));
        }
        let colour = match role {
            Role::Fitted => NEUTRAL,
            Role::HeldOut => AFTER,
            Role::Other => OTHER,
        };
        data.push(json!({
            "type": "scatter3d", "mode": "lines", "name": format!("{} ({})", role.name(), boards.len()),
            "x": x, "y": y, "z": z, "text": text, "connectgaps": false,
            "line": {"color": colour, "width": 3},
            "hovertemplate": "frame %{text}: %{y:.0f} mm<extra></extra>",
        }));
    }
    if let Some(c) = camera.calibrated {
        data.push(frustum(&c.camera, |p| p, 0.22 * reach[1], ["camera", BEFORE], 0));
    }
    let axis = |title: &str| json!({"title": {"text": title}, "nticks": 6});
    let layout = json!({
        "scene": {
            "aspectmode": "data", "xaxis": axis("x / mm"), "yaxis": axis("distance / mm"), "zaxis": axis("up / mm"),
            "camera": {"eye": {"x": -1.05, "y": -1.25, "z": 0.65}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}},
        },
        "margin": {"l": 0, "r": 0, "t": 24, "b": 0},
    });
    let boards: usize = groups.iter().map(|g| g.1.len()).sum();
    Some(
        Figure::new("poses", "The boards in front of the camera", data, layout)
            .caption(format!(
                "Outlines of the markers of {}, {} to {} mm from the camera (the pyramid). Drag to turn. Errors are known within \
                 this volume only.",
                count(boards, "board"),
                number(reach[0]),
                number(reach[1])
            ))
            .alt(format!("{} drawn in space in front of the camera.", count(boards, "board")))
            .aspect(1.35),
    )
}

/// The pyramid of a camera's field of view as deep as `depth`, mm; `in_space` takes points of the camera to those of the drawing,
/// which has so many decimals.
pub(super) fn frustum(
    camera: &Camera,
    in_space: impl Fn([f64; 3]) -> [f64; 3],
    depth: f64,
    [name, colour]: [&str; 2],
    decimals: i32,
) -> Value {
    let (w, h) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    let [fx, fy, cx, cy, _] = camera.pinhole();
    let corner = |u: f64, v: f64| {
        // Where the lens cannot be inverted the pinhole alone is good enough for a drawing.
        let [x, y] = camera.ray([u, v], 1.0 / depth).unwrap_or([(u - cx) / fx, (v - cy) / fy]);
        in_space([x * depth, y * depth, depth])
    };
    let c = [corner(0.0, 0.0), corner(w, 0.0), corner(w, h), corner(0.0, h)];
    let o = in_space([0.0; 3]);
    let path = [o, c[0], c[1], o, c[2], c[1], c[2], c[3], o, c[0], c[3]];
    let part = |i: usize, sign: f64| -> Value { path.iter().map(|p| rounded(sign * p[i], decimals)).collect() };
    json!({
        "type": "scatter3d", "mode": "lines", "name": name, "x": part(0, 1.0), "y": part(2, 1.0), "z": part(1, -1.0),
        "line": {"color": colour, "width": 4}, "hoverinfo": "name",
    })
}
