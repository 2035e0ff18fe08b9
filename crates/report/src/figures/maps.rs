//! Depth errors as maps over the image and over the board.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{colour_bar, diverging, image_axes, map_axes, short};
use crate::binned::{Axis, Binned, Cell};
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

/// Ends of the middle nine tenths of the cells.
fn range(cells: &[Cell]) -> String {
    let error_mm = |q: f64| number(quantile(cells.iter().map(|c| c.value), q));
    format!("{} to {} mm (5 % to 95 % of the cells)", error_mm(0.05), error_mm(0.95))
}

/// Cells over the image.
struct OverImage<'a> {
    camera: &'a ReportCamera<'a>,
    image: &'a Image,
    grid: [usize; 2],
}

impl<'a> OverImage<'a> {
    fn new(camera: &'a ReportCamera<'a>, image: &'a Image) -> Self {
        Self { camera, image, grid: image.grid(MAP_COLUMNS) }
    }

    fn cells(&self, pool: &Pool<'_>, value: impl Fn(&PixelError) -> f64) -> Vec<Cell> {
        let cell = |p: &PixelError| self.image.cell(self.grid, p.context.pixel);
        Binned::new(pool, self.grid[0] * self.grid[1], cell, value, noise_mm(self.camera)).cells()
    }

    fn figure(&self, [id, title]: [&str; 2], cells: &[Cell], limit: f64, marked: bool) -> Figure {
        let Self { image, grid: [columns, rows], .. } = *self;
        let middle = |i: usize| image.middle(self.grid, i);
        let x: Value = (0..columns).map(|column| short(middle(column)[0])).collect();
        let y: Value = (0..rows).map(|row| short(middle(row * columns)[1])).collect();
        let mut data = vec![heat(cells, columns, &x, &y, limit)];
        if marked {
            data.push(marks(cells, middle));
        }
        Figure::new(id, title, data, image_axes(image))
            .alt(format!("{title}: {}.", range(cells)))
            .aspect(image.width / image.height * 1.02)
    }
}

/// Cells over the board, of corrected errors.
struct OverBoard<'a> {
    camera: &'a ReportCamera<'a>,
    axes: [Axis; 2],
}

impl<'a> OverBoard<'a> {
    /// `None` without depth.
    fn new(camera: &'a ReportCamera<'a>, pool: &Pool<'_>) -> Option<Self> {
        Some(Self { camera, axes: board_axes(pool)? })
    }

    fn cells(&self, pool: &Pool<'_>) -> Vec<Cell> {
        let [x, y] = &self.axes;
        let cell = |p: &PixelError| Some(y.bin(p.board[1])? * BOARD_GRID[0] + x.bin(p.board[0])?);
        Binned::new(pool, BOARD_GRID[0] * BOARD_GRID[1], cell, |p| p.after_mm, noise_mm(self.camera)).cells()
    }

    fn figure(&self, [id, title]: [&str; 2], cells: &[Cell], limit: f64) -> Figure {
        let [ax, ay] = &self.axes;
        let x: Value = (0..BOARD_GRID[0]).map(|i| short(ax.middle(i))).collect();
        let y: Value = (0..BOARD_GRID[1]).map(|i| short(ay.middle(i))).collect();
        let place = |i: usize| [ax.middle(i % BOARD_GRID[0]), ay.middle(i / BOARD_GRID[0])];
        let data = vec![heat(cells, BOARD_GRID[0], &x, &y, limit), marks(cells, place)];
        Figure::new(id, title, data, map_axes(["board x / mm", "board y / mm"])).aspect(1.3)
    }
}

/// Maps over the image: as measured, corrected in the same colours, and corrected on a colour scale of its own.
pub(crate) fn image_maps(camera: &ReportCamera<'_>, image: &Image) -> Vec<Figure> {
    let pool = tested_frames(camera);
    if !pool.has_depth() {
        return Vec::new();
    }
    let over = OverImage::new(camera, image);
    let (before, after) = (over.cells(&pool, |p| p.before_mm), over.cells(&pool, |p| p.after_mm));
    let shared = limit(&before).max(limit(&after));
    vec![
        over.figure(["map-before", "Depth error as measured"], &before, shared, false).caption(format!(
            "Mean over {} frames of each frame's median error in the cell, measured minus the board's depth: orange is \
             too far, blue too near. {}.",
            pool.frame_count(),
            capital(&range(&before))
        )),
        over.figure(["map-after", "After correction, same colours"], &after, shared, false)
            .caption(format!("{}. White: corrected.", capital(&range(&after)))),
        over.figure(["map-left", "After correction, on a colour scale of its own"], &after, limit(&after), true)
            .caption(format!(
                "Dots: the cell's 95 % interval, typically ± {} mm, does not contain zero. By chance one cell in twenty has a dot.",
                number(noise_level(&after))
            )),
    ]
}

/// Corrected error over the board, where a bent board or a bad print shows; `None` without depth.
pub(crate) fn board_map(camera: &ReportCamera<'_>) -> Option<Figure> {
    let pool = tested_frames(camera);
    let over = OverBoard::new(camera, &pool)?;
    let cells = over.cells(&pool);
    Some(
        over.figure(["map-board", "After correction, over the board"], &cells, limit(&cells))
            .caption(format!(
                "Corrected depth error over the board. A bent board shows as a bowl or a saddle, brightness of the print as its \
                 pattern. 95 % interval of a cell: ± {} mm.",
                number(noise_level(&cells))
            ))
            .alt("Map of the corrected depth error over the board."),
    )
}

/// Maps over the image: as measured, and under the declared and the last model in the same colours.
pub(crate) fn image_maps_by_model(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>, image: &Image) -> Vec<Figure> {
    let (declared, now) = (Pool::declared(d), Pool::last(camera));
    if !now.has_depth() {
        return Vec::new();
    }
    let over = OverImage::new(camera, image);
    let raw = over.cells(&now, |p| p.before_mm);
    let [before, after] = [&declared, &now].map(|pool| over.cells(pool, |p| p.after_mm));
    let shared = limit(&before).max(limit(&after));
    vec![
        over.figure(["map-before", "As measured"], &raw, limit(&raw), false).caption(format!(
            "Mean over {} frames of each frame's median depth error in the cell: orange is too far, blue too near. {}.",
            now.frame_count(),
            range(&raw)
        )),
        over.figure(["map-declared", "Corrected by the declared model"], &before, shared, true)
            .caption(format!("{}. Dots: the cell's 95 % interval does not contain zero.", range(&before))),
        over.figure(["map-after", "Corrected by the last model, same colours"], &after, shared, true)
            .caption(format!("{}. By chance one cell in twenty has a dot.", range(&after))),
    ]
}

/// Errors over the board under the declared and the last model, in the same colours; empty without depth.
pub(crate) fn board_maps_by_model(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> Vec<Figure> {
    let (declared, now) = (Pool::declared(d), Pool::last(camera));
    let Some(over) = OverBoard::new(camera, &now) else { return Vec::new() };
    let (before, after) = (over.cells(&declared), over.cells(&now));
    let shared = limit(&before).max(limit(&after));
    let figure = |[id, title]: [&str; 2], cells: &[Cell], told: String| {
        let rms = number(rms(cells.iter().map(|c| c.value)));
        let caption = format!("{rms} mm rms over the cells{told}");
        over.figure([id, title], cells, shared).caption(caption).alt(format!("{title}: a map."))
    };
    vec![
        figure(
            ["map-board-declared", "Over the board, declared model"],
            &before,
            ". A bent board shows as a bowl or a saddle, brightness of the print as its pattern.".to_owned(),
        ),
        figure(
            ["map-board", "Over the board, last model, same colours"],
            &after,
            format!("; 95 % interval of a cell: ± {} mm.", number(noise_level(&after))),
        ),
    ]
}
