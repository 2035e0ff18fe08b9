//! Where in the image, at which distances and angles there were boards.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, NEUTRAL, OTHER, colour_bar, image_axes, plain, rounded, sequential, short};
use crate::covariates::Image;
use crate::format::count;
use crate::input::{ReportCamera, Role};
use crate::pool::Pool;

/// Number of frames that saw each part of the image.
pub(crate) fn coverage(camera: &ReportCamera<'_>, image: &Image) -> Option<Figure> {
    let pool = Pool::of(camera, |_| true);
    let grid = image.grid(20);
    let mut frames = vec![0_usize; grid[0] * grid[1]];
    let depth = pool.has_depth();
    for f in &pool.frames {
        let mut seen = vec![false; frames.len()];
        let markers = f.frame.reprojection.iter().map(|e| [e[0], e[1]]);
        let pixels = f.frame.pixels.iter().map(|p| p.context.pixel);
        let mut mark = |p: [f64; 2]| image.cell(grid, p).into_iter().for_each(|c| seen[c] = true);
        if depth {
            pixels.for_each(&mut mark)
        } else {
            markers.for_each(&mut mark)
        }
        frames.iter_mut().zip(&seen).for_each(|(n, s)| *n += usize::from(*s));
    }
    if frames.iter().all(|n| *n == 0) {
        return None;
    }
    let z: Value = frames
        .chunks(grid[0])
        .map(|row| row.iter().map(|n| if *n == 0 { Value::Null } else { json!(n) }).collect::<Value>())
        .collect();
    let data = json!({
        "type": "heatmap", "z": z, "zmin": 0, "colorscale": sequential(), "colorbar": colour_bar("frames"),
        "x": (0..grid[0]).map(|c| short(image.middle(grid, c)[0])).collect::<Value>(),
        "y": (0..grid[1]).map(|r| short(image.middle(grid, r * grid[0])[1])).collect::<Value>(),
        "hoverongaps": false, "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z} frames<extra></extra>",
    });
    let empty = frames.iter().filter(|n| **n == 0).count();
    let share = 100 * (frames.len() - empty) / frames.len();
    let what = if depth { "depth on the board" } else { "a marker" };
    Some(
        Figure::new("coverage", "Coverage of the image", vec![data], image_axes(image))
            .caption(format!(
                "Number of frames with {what} in each part of the image; {share} % of it were reached. In empty cells the model \
                 extrapolates."
            ))
            .alt(format!("Map of the image: boards reached {share} per cent of it."))
            .aspect(image.width / image.height * 1.02),
    )
}

/// Distance and tilt of every board.
pub(crate) fn distance_and_tilt(camera: &ReportCamera<'_>) -> Option<Figure> {
    let pool = Pool::of(camera, |_| true);
    let mut data = Vec::new();
    for (role, colour, symbol) in
        [(Role::Fitted, NEUTRAL, "circle"), (Role::HeldOut, AFTER, "diamond"), (Role::Other, OTHER, "square")]
    {
        let boards: Vec<_> = pool.frames.iter().filter(|f| f.role == role).collect();
        if boards.is_empty() {
            continue;
        }
        let tilt = |f: &&crate::pool::Pooled<'_>| {
            let normal = f.frame.camera_from_board.rotation * nalgebra::Vector3::z();
            rounded(normal.z.abs().min(1.0).acos().to_degrees(), 1)
        };
        data.push(json!({
            "type": "scatter", "mode": "markers", "name": role.name(),
            "x": boards.iter().map(|f| rounded(f.frame.camera_from_board.translation.vector.z, 0)).collect::<Value>(),
            "y": boards.iter().map(tilt).collect::<Value>(),
            "text": boards.iter().map(|f| plain(&f.frame.name)).collect::<Value>(),
            "marker": {"color": colour, "size": 9, "symbol": symbol, "opacity": 0.85},
            "hovertemplate": "frame %{text}: %{x:.0f} mm, %{y:.0f}°<extra>%{fullData.name}</extra>",
        }));
    }
    let layout = json!({
        "xaxis": {"title": {"text": "distance of the board / mm"}, "rangemode": "tozero"},
        "yaxis": {"title": {"text": "tilt / °"}, "rangemode": "tozero"},
    });
    (!data.is_empty()).then(|| {
        Figure::new("distance-tilt", "Distance and tilt of the boards", data, layout)
            .caption(
                "One mark per frame. Several distances separate an offset of depth from a scale of depth; tilted boards \
                 separate the focal length from the distance.",
            )
            .alt(format!("Distance and tilt of {}.", count(pool.frame_count(), "board")))
            .aspect(1.45)
    })
}
