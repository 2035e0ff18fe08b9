//! Depth errors as maps over the image and over the board.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{colour_bar, diverging, image_axes, short};
use crate::binned::{Binned, Cell};
use crate::covariates::Image;
use crate::format::{capital, number};
use crate::input::ReportCamera;
use crate::input::ReportDiagnosis;
use crate::leftover::{BOARD_GRID, MAP_COLUMNS, board_axes, noise_mm, tested_frames};
use crate::pool::Pool;
use crate::statistics::rms;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_statistics::quantile;

/// A map of cells, row by row.
fn heat(cells: &[Cell], columns: usize, x: &Value, y: &Value, limit: f64) -> Value {
    let rows = |f: &dyn Fn(&Cell) -> Value| -> Value {
        cells.chunks(columns).map(|row| row.iter().map(f).collect::<Value>()).collect()
    };
    let note = |c: &Cell| {
        let half = if c.half.is_finite() { format!("± {} mm", number(c.half)) } else { "interval unknown".to_owned() };
        json!(format!("{half}, {} frames", c.frames))
    };
    json!({
        "type": "heatmap", "x": x, "y": y, "z": rows(&|c| short(c.value)), "text": rows(&note),
        "zmin": -limit, "zmax": limit, "colorscale": diverging(), "colorbar": colour_bar("mm"), "hoverongaps": false,
        "hovertemplate": "(%{x:.0f}, %{y:.0f}): %{z:+.3~g} mm %{text}<extra></extra>",
    })
}

/// Dots on cells whose interval does not contain zero.
fn marks(cells: &[Cell], at: impl Fn(usize) -> [f64; 2]) -> Value {
    let sure: Vec<[f64; 2]> = cells.iter().enumerate().filter(|(_, c)| c.stands_out()).map(|(i, _)| at(i)).collect();
    json!({
        "type": "scatter", "mode": "markers", "hoverinfo": "skip", "showlegend": false,
        "x": sure.iter().map(|p| short(p[0])).collect::<Value>(),
        "y": sure.iter().map(|p| short(p[1])).collect::<Value>(),
        "marker": {"symbol": "circle", "size": 4, "color": "#111111", "opacity": 0.65},
    })
}

fn limit(cells: &[Cell]) -> f64 {
    quantile(cells.iter().filter(|c| c.pixels > 0).map(|c| c.value.abs()), 0.98).max(1e-3)
}

/// Typical half width of a cell's interval, mm.
fn noise_level(cells: &[Cell]) -> f64 {
    quantile(cells.iter().map(|c| c.half), 0.5)
}

/// Maps over the image: as measured, corrected in the same colours, and corrected on a colour scale of its own.
pub(crate) fn image_maps(camera: &ReportCamera<'_>, image: &Image) -> Vec<Figure> {
    let pool = tested_frames(camera);
    if !pool.has_depth() {
        return Vec::new();
    }
    let grid = image.grid(MAP_COLUMNS);
    let n = grid[0] * grid[1];
    let bins = |value: &dyn Fn(&PixelError) -> f64| {
        Binned::new(&pool, n, |p| image.cell(grid, p.context.pixel), value, noise_mm(camera)).cells()
    };
    let (before, after) = (bins(&|p| p.before_mm), bins(&|p| p.after_mm));
    let x: Value = (0..grid[0]).map(|c| short(image.middle(grid, c)[0])).collect();
    let y: Value = (0..grid[1]).map(|r| short(image.middle(grid, r * grid[0])[1])).collect();
    let shared = limit(&before).max(limit(&after));
    let left_limit = limit(&after);
    let layout = image_axes(image);
    let aspect = image.width / image.height * 1.02;
    let range = |cells: &[Cell]| {
        let error_mm = |q: f64| number(quantile(cells.iter().map(|c| c.value), q));
        format!("{} to {} mm (5 % to 95 % of the cells)", error_mm(0.05), error_mm(0.95))
    };
    let figure = |id: &str, title: &str, cells: &[Cell], limit: f64, marked: bool| {
        let mut data = vec![heat(cells, grid[0], &x, &y, limit)];
        if marked {
            data.push(marks(cells, |i| image.middle(grid, i)));
        }
        Figure::new(id, title, data, layout.clone()).alt(format!("{title}: {}.", range(cells))).aspect(aspect)
    };
    let frames = pool.frame_count();
    vec![
        figure("map-before", "Depth error as measured", &before, shared, false).caption(format!(
            "Mean over {frames} frames of each frame's median error in the cell, measured minus the board's depth: orange is \
             too far, blue too near. {}.",
            capital(&range(&before))
        )),
        figure("map-after", "After correction, same colours", &after, shared, false)
            .caption(format!("{}. White: corrected.", capital(&range(&after)))),
        figure("map-left", "After correction, on a colour scale of its own", &after, left_limit, true).caption(format!(
            "Dots: the cell's 95 % interval, typically ± {} mm, does not contain zero. By chance one cell in twenty has a dot.",
            number(noise_level(&after))
        )),
    ]
}

/// Corrected error over the board, where a bent board or a bad print shows; `None` without depth.
pub(crate) fn board_map(camera: &ReportCamera<'_>) -> Option<Figure> {
    let pool: Pool<'_> = tested_frames(camera);
    let [ax, ay] = board_axes(&pool)?;
    let cell = |p: &PixelError| Some(ay.bin(p.board[1])? * BOARD_GRID[0] + ax.bin(p.board[0])?);
    let cells = Binned::new(&pool, BOARD_GRID[0] * BOARD_GRID[1], cell, |p| p.after_mm, noise_mm(camera)).cells();
    let x: Value = (0..BOARD_GRID[0]).map(|i| short(ax.middle(i))).collect();
    let y: Value = (0..BOARD_GRID[1]).map(|i| short(ay.middle(i))).collect();
    let layout = json!({
        "xaxis": {"title": {"text": "board x / mm"}, "constrain": "domain", "showgrid": false},
        "yaxis": {"title": {"text": "board y / mm"}, "autorange": "reversed", "scaleanchor": "x",
                  "constrain": "domain", "showgrid": false},
    });
    let place = |i: usize| [ax.middle(i % BOARD_GRID[0]), ay.middle(i / BOARD_GRID[0])];
    let data = vec![heat(&cells, BOARD_GRID[0], &x, &y, limit(&cells)), marks(&cells, place)];
    Some(
        Figure::new("map-board", "After correction, over the board", data, layout)
            .caption(format!(
                "Corrected depth error over the board. A bent board shows as a bowl or a saddle, brightness of the print as its \
                 pattern. 95 % interval of a cell: ± {} mm.",
                number(noise_level(&cells))
            ))
            .alt("Map of the corrected depth error over the board.")
            .aspect(1.3),
    )
}

/// Maps over the image: as measured, and under the declared and the last model in the same colours.
pub(crate) fn image_maps_by_model(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>, image: &Image) -> Vec<Figure> {
    let (declared, now) = (Pool::declared(d), Pool::last(camera));
    if !now.has_depth() {
        return Vec::new();
    }
    let grid = image.grid(MAP_COLUMNS);
    let bins = |pool: &Pool<'_>, value: &dyn Fn(&PixelError) -> f64| {
        Binned::new(pool, grid[0] * grid[1], |p| image.cell(grid, p.context.pixel), value, noise_mm(camera)).cells()
    };
    let raw = bins(&now, &|p| p.before_mm);
    let (before, after) = (bins(&declared, &|p| p.after_mm), bins(&now, &|p| p.after_mm));
    let x: Value = (0..grid[0]).map(|c| short(image.middle(grid, c)[0])).collect();
    let y: Value = (0..grid[1]).map(|r| short(image.middle(grid, r * grid[0])[1])).collect();
    let shared = limit(&before).max(limit(&after));
    let range = |cells: &[Cell]| {
        let error_mm = |q: f64| number(quantile(cells.iter().map(|c| c.value), q));
        format!("{} to {} mm (5 % to 95 % of the cells)", error_mm(0.05), error_mm(0.95))
    };
    let figure = |id: &str, title: &str, cells: &[Cell], limit: f64, marked: bool, caption: String| {
        let mut data = vec![heat(cells, grid[0], &x, &y, limit)];
        if marked {
            data.push(marks(cells, |i| image.middle(grid, i)));
        }
        Figure::new(id, title, data, image_axes(image))
            .caption(caption)
            .alt(format!("{title}: {}.", range(cells)))
            .aspect(image.width / image.height * 1.02)
    };
    vec![
        figure(
            "map-before",
            "As measured",
            &raw,
            limit(&raw),
            false,
            format!(
                "Mean over {} frames of each frame's median depth error in the cell: orange is too far, blue too near. {}.",
                now.frame_count(),
                range(&raw)
            ),
        ),
        figure(
            "map-declared",
            "Corrected by the declared model",
            &before,
            shared,
            true,
            format!("{}. Dots: the cell's 95 % interval does not contain zero.", range(&before)),
        ),
        figure(
            "map-after",
            "Corrected by the last model, same colours",
            &after,
            shared,
            true,
            format!("{}. By chance one cell in twenty has a dot.", range(&after)),
        ),
    ]
}

/// Errors over the board under the declared and the last model, in the same colours; empty without depth.
pub(crate) fn board_maps_by_model(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> Vec<Figure> {
    let (declared, now) = (Pool::declared(d), Pool::last(camera));
    let Some([ax, ay]) = board_axes(&now) else { return Vec::new() };
    let cell = |p: &PixelError| Some(ay.bin(p.board[1])? * BOARD_GRID[0] + ax.bin(p.board[0])?);
    let bins = |pool: &Pool<'_>| {
        Binned::new(pool, BOARD_GRID[0] * BOARD_GRID[1], cell, |p| p.after_mm, noise_mm(camera)).cells()
    };
    let (before, after) = (bins(&declared), bins(&now));
    let shared = limit(&before).max(limit(&after));
    let x: Value = (0..BOARD_GRID[0]).map(|i| short(ax.middle(i))).collect();
    let y: Value = (0..BOARD_GRID[1]).map(|i| short(ay.middle(i))).collect();
    let place = |i: usize| [ax.middle(i % BOARD_GRID[0]), ay.middle(i / BOARD_GRID[0])];
    let layout = json!({
        "xaxis": {"title": {"text": "board x / mm"}, "constrain": "domain", "showgrid": false},
        "yaxis": {"title": {"text": "board y / mm"}, "autorange": "reversed", "scaleanchor": "x",
                  "constrain": "domain", "showgrid": false},
    });
    let figure = |id: &str, title: &str, cells: &[Cell], caption: String| {
        let data = vec![heat(cells, BOARD_GRID[0], &x, &y, shared), marks(cells, place)];
        Figure::new(id, title, data, layout.clone()).caption(caption).alt(format!("{title}: a map.")).aspect(1.3)
    };
    let rms = |cells: &[Cell]| number(rms(cells.iter().map(|c| c.value)));
    vec![
        figure(
            "map-board-declared",
            "Over the board, declared model",
            &before,
            format!(
                "{} mm rms over the cells. A bent board shows as a bowl or a saddle, brightness of the print as its pattern.",
                rms(&before)
            ),
        ),
        figure(
            "map-board",
            "Over the board, last model, same colours",
            &after,
            format!(
                "{} mm rms over the cells; 95 % interval of a cell: ± {} mm.",
                rms(&after),
                number(noise_level(&after))
            ),
        ),
    ]
}
