//! Tests for systematic errors that are left after correction.
//!
//! Errors are binned over every known quantity of a pixel. A smooth pattern over the bins on which the frames agree is an
//! error that the model does not describe. The tests name no cause; that is what a diagnosis does.

use super::binned::{Axis, Binned, smooth, smooth_over};
use super::covariates::{BINS, Image, all};
use super::finding::{Finding, Over};
use super::format::join;
use super::format::{count, number, signed};
use super::input::{ReportCamera, ReportDataset, Role};
use super::pool::Pool;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_calibration::judge::whole_frames::whole_frames;

/// Columns of the map over the image.
pub(super) const MAP_COLUMNS: usize = 20;
/// Columns and rows of the map over the board.
pub(super) const BOARD_GRID: [usize; 2] = [12, 12];
/// Fewest frames for a test: 2⁸ patterns of signs are enough for its level.
const FEWEST_FRAMES: usize = 8;
/// With at least this many held-out frames they alone are tested; else all frames.
const ENOUGH_HELD_OUT: usize = 12;
/// Order of the polynomials over one quantity.
const ORDER: usize = 6;
/// Total order of the polynomials over image and board.
const ORDER_OVER: usize = 4;
/// Probability of a false alarm, over all tests together.
const FALSE_ALARM: f64 = 0.05;
/// A systematic error is reported from this share of the total error on.
const WORTH: f64 = 0.1;
/// Tests that could miss this share of the total error are inconclusive.
const HIDDEN: f64 = 0.8;

/// The outcome of all tests, those that found something first.
#[derive(Debug, Clone)]
pub(super) struct Leftover {
    pub findings: Vec<Finding>,
    /// Number of tested frames.
    pub frames: usize,
    /// Whether fitted frames are among them.
    pub with_fitted: bool,
    /// Root mean square of all corrected errors, mm.
    total_mm: f64,
}

/// Noise of a depth pixel in mm, from the calibration's noise law; 1 where there is none.
pub(super) fn noise_mm(camera: &ReportCamera<'_>) -> impl Fn(&PixelError) -> f64 + Copy {
    let noise = camera.calibrated.filter(|c| c.with_depth).map(|c| c.noise.depth);
    move |p| noise.map_or(1.0, |n| n.sigma(1.0 / p.board_depth_mm) * p.board_depth_mm.powi(2))
}

/// The frames of tests and maps: held-out ones where there are enough of them.
pub(super) fn tested_frames<'a>(camera: &ReportCamera<'a>) -> Pool<'a> {
    let held_out = Pool::of(camera, |r| r != Role::Fitted);
    if held_out.frames.len() >= ENOUGH_HELD_OUT { held_out } else { Pool::of(camera, |_| true) }
}

impl Leftover {
    /// Runs all tests; `None` without depth, or with too few frames.
    pub(super) fn of(camera: &ReportCamera<'_>, image: &Image) -> Option<Self> {
        let pool = tested_frames(camera);
        let frames = pool.frames.iter().filter(|f| !f.frame.pixels.is_empty()).count();
        if frames < FEWEST_FRAMES {
            return None;
        }
        let total = pool.depth_rms()?.after.value;
        let sigma = noise_mm(camera);
        let after = |p: &PixelError| p.after_mm;
        let mut findings = Vec::new();

        let grid = image.grid(MAP_COLUMNS);
        let map = Binned::new(&pool, grid[0] * grid[1], |p| image.cell(grid, p.context.pixel), after, sigma);
        let basis = smooth_over(grid, ORDER_OVER);
        findings.push(finding("the position in the image", &map, &basis, |c| image.place(image.middle(grid, c))));

        if let Some([x, y]) = board_axes(&pool) {
            let cell = |p: &PixelError| Some(y.bin(p.board[1])? * BOARD_GRID[0] + x.bin(p.board[0])?);
            let board = Binned::new(&pool, BOARD_GRID[0] * BOARD_GRID[1], cell, after, sigma);
            let place = |c: usize| {
                let middle = [x.middle(c % BOARD_GRID[0]), y.middle(c / BOARD_GRID[0])];
                format!("on the board around ({:.0}, {:.0}) mm", middle[0], middle[1])
            };
            let basis = smooth_over(BOARD_GRID, ORDER_OVER);
            findings.push(finding("the position on the board", &board, &basis, place));
        }
        for covariate in all(camera, image) {
            let Some(axis) = Axis::over(pool.pixels().map(&covariate.value), BINS) else { continue };
            let binned = Binned::new(&pool, BINS, |p| axis.bin((covariate.value)(p)), after, sigma);
            let place = |c: usize| format!("around {} {}", number(axis.middle(c)), covariate.unit);
            let basis = smooth(BINS, ORDER);
            findings.push(finding(&format!("the {}", covariate.name), &binned, &basis, place));
        }
        findings.extend(frames_as_wholes(camera));
        let level = FALSE_ALARM / findings.len() as f64;
        for f in &mut findings {
            f.found = f.structure.p_value < level && f.structure.size_mm > WORTH * total;
        }
        findings.sort_by(|a, b| {
            (b.found, b.structure.size_mm)
                .partial_cmp(&(a.found, a.structure.size_mm))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let with_fitted = pool.frames.iter().any(|f| f.role == Role::Fitted);
        Some(Self { findings, frames, with_fitted, total_mm: total })
    }

    /// The systematic errors that noise does not explain.
    pub(super) fn found(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| f.found)
    }

    /// The largest systematic error that the tests could miss, mm rms.
    fn hidden_mm(&self) -> f64 {
        self.findings.iter().map(|f| f.structure.hidden_mm).fold(0.0, f64::max)
    }

    /// Whether the tests could miss a systematic error comparable to the total error.
    pub(super) fn could_hide_much(&self) -> bool {
        self.hidden_mm() > HIDDEN * self.total_mm
    }

    /// The outcome in a sentence or two.
    pub(super) fn sentence(&self) -> String {
        let frames = count(self.frames, "frame");
        let findings: Vec<&Finding> = self.found().collect();
        let Some(first) = findings.first() else {
            let hidden = number(self.hidden_mm());
            return if self.could_hide_much() {
                format!(
                    "No systematic error was found, but these {frames} could hide one of {hidden} mm rms: too few \
                     frames to decide."
                )
            } else {
                format!(
                    "Nothing is left that the noise of these {frames} does not explain; a systematic error below \
                     {hidden} mm rms would go unnoticed."
                )
            };
        };
        // A pattern says more about the cause than frames that are off as a whole.
        let first = findings.iter().find(|f| f.over != Over::WholeFrames).unwrap_or(first);
        let size = number(first.structure.size_mm);
        if first.over == Over::WholeFrames {
            let patterns = self.findings.iter().filter(|f| f.over != Over::WholeFrames);
            let likely = patterns.min_by(|a, b| a.structure.p_value.total_cmp(&b.structure.p_value));
            let follows = match likely.filter(|f| f.structure.p_value < FALSE_ALARM) {
                Some(f) => format!("It depends most on {}, but not significantly.", f.over),
                None => "These frames do not show what it depends on.".to_owned(),
            };
            return format!(
                "Something is left that this model does not describe: whole frames are off by {size} mm rms more than \
                 noise explains, most {}. {follows}",
                first.worst
            );
        }
        let mut text = format!(
            "Something is left that this model does not describe: a systematic error of {size} mm rms over {}, largest {}.",
            first.over, first.worst
        );
        let others = || findings.iter().filter(|f| f.over != first.over && f.over != Over::WholeFrames);
        if others().next().is_some() {
            let others: Vec<String> =
                others().map(|f| format!("{} ({} mm rms)", f.over, number(f.structure.size_mm))).collect();
            text += &format!(" There is also one over {}.", join(&others));
        }
        text
    }
}

/// How far frames are off as wholes: of held-out ones, where there are enough, of the dataset where that is least likely chance.
fn frames_as_wholes(camera: &ReportCamera<'_>) -> Option<Finding> {
    let fit = camera.calibrated?;
    let of_dataset = |d: &ReportDataset<'_>| Some((d.role == Role::Fitted, whole_frames(fit, &d.evaluated.frames)?));
    let tested = camera.evaluations.iter().filter_map(of_dataset);
    let (_, frames) = tested.min_by(|a, b| a.0.cmp(&b.0).then(a.1.p_value.total_cmp(&b.1.p_value)))?;
    Some(Finding::of_whole_frames(&frames))
}

/// Bins along both sides of the board, from the pixels on it.
pub(super) fn board_axes(pool: &Pool<'_>) -> Option<[Axis; 2]> {
    let axis = |i: usize| Axis::over(pool.pixels().map(move |p| p.board[i]), BOARD_GRID[i]);
    Some([axis(0)?, axis(1)?])
}

fn finding(over: &str, binned: &Binned, basis: &[Vec<f64>], place: impl Fn(usize) -> String) -> Finding {
    let cells = binned.cells();
    let sure = cells.iter().enumerate().filter(|(_, c)| c.stands_out());
    let worst = sure.max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs())).map(|(i, c)| {
        let side = if c.value > 0.0 { "too far" } else { "too near" };
        format!("{}: {} ± {} mm, {side}", place(i), signed(c.value), number(c.half))
    });
    Finding {
        over: Over::Quantity(over.to_owned()),
        structure: binned.structure(basis),
        worst: worst.unwrap_or_else(|| "at no single place".to_owned()),
        found: false,
    }
}
