//! Fine patterns of half the noise: of columns, of rows, of a mosaic of pixels, and of the board's print.

use std::path::Path;

use depthcal::calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, diagnose_camera};
use depthcal::calibration::observe::PixelRays;
use depthcal::calibration::observe::board_plane::BoardPlane;
use depthcal::io::{DepthImage, Verdict, read_depth, write_depth};
use depthcal::model::Context;
use depthcal_simulate::Noise;
use rayon::prelude::*;

use super::drawn::drawn_of;
use super::{Failure, Study, load_anew, percent};

const FRAMES: usize = 24;
/// Period of a pattern, px of the image or, of the print, mm of the board.
const PERIODS: [f64; 5] = [2.0, 5.0, 12.0, 35.0, 100.0];
const SHARE_OF_NOISE: f64 = 0.5;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Pattern {
    Columns,
    Rows,
    Mosaic,
    Print,
}

impl Pattern {
    const ALL: [Self; 4] = [Self::Columns, Self::Rows, Self::Mosaic, Self::Print];

    /// 1 or −1 at a pixel that sees a board point.
    fn sign(self, pixel: [usize; 2], board: [f64; 2], period: f64) -> f64 {
        let cell = |x: f64| (2.0 * x / period).floor() as i64;
        let [u, v] = pixel.map(|x| cell(x as f64));
        let odd = match self {
            Self::Columns => u,
            Self::Rows => v,
            Self::Mosaic => u + v,
            Self::Print => cell(board[0]) + cell(board[1]),
        };
        if odd.rem_euclid(2) == 0 { 1.0 } else { -1.0 }
    }
}

impl Study {
    /// One capture per seed, pattern and period.
    pub fn fine(&self) {
        println!("| pattern | period | seen | verdict not adequate |");
        println!("|---|---|---|---|");
        let mut all = Vec::new();
        for pattern in Pattern::ALL {
            for period in PERIODS {
                let run = |seed| {
                    let seen = patterned(pattern, period, seed);
                    seen.inspect_err(|e| eprintln!("{pattern:?} {period} {seed}: {e}")).ok()
                };
                let runs: Vec<[bool; 2]> = self.numbers().into_par_iter().filter_map(run).collect();
                row(&format!("{pattern:?}"), &format!("{period}"), &runs);
                all.extend(runs);
            }
        }
        row("all", "", &all);
    }
}

fn row(name: &str, period: &str, runs: &[[bool; 2]]) {
    let count = |i: usize| percent(runs.iter().filter(|r| r[i]).count(), runs.len());
    println!("| {name} | {period} | {} | {} |", count(0), count(1));
}

/// Whether the residuals are said to share something, and whether the verdict is another than `adequate`.
fn patterned(pattern: Pattern, period: f64, seed: u64) -> Result<[bool; 2], Failure> {
    let drawn = drawn_of(&[], seed, Some(FRAMES))?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("capture");
    drawn.simulation.write_dataset(&path)?;
    let fit = calibrate_camera(&load_anew(&path)?, &CameraOptions::default())?;
    plant(&path, &fit, &drawn.noise, pattern, period)?;
    let d = diagnose_camera(&load_anew(&path)?, None, &CameraDiagnoseOptions::default())?;
    let shares = d.pure_error.as_ref().is_some_and(|p| !p.shared.is_empty());
    let ratio = d.pure_error.as_ref().map_or(f64::NAN, |p| p.ratio());
    eprintln!("{pattern:?} {period} {seed}: {:?} shared {shares}, ratio {ratio:.3}", d.verdict);
    Ok([shares || d.verdict != Verdict::Adequate, d.verdict != Verdict::Adequate])
}

/// Adds a pattern to the depth images of a dataset.
fn plant(path: &Path, fit: &CalibratedCamera, noise: &Noise, pattern: Pattern, period: f64) -> Result<(), Failure> {
    let unit_mm = fit.capture.depth_unit_mm.unwrap_or(1.0);
    let rays = PixelRays::new(&fit.camera, &fit.capture.target);
    for frame in &fit.capture.frames {
        let file = path.join("depth").join(format!("{}.png", frame.name));
        let mut depth = read_depth(&file)?;
        let plane = BoardPlane::new(&frame.camera_from_board);
        for v in 0..depth.height {
            for u in 0..depth.width {
                let raw = &mut depth.data[v * depth.width + u];
                let context = Context { pixel: [u as f64, v as f64], ..Context::default() };
                let z = f64::from(*raw) * unit_mm;
                if !DepthImage::is_measurement(*raw) {
                    continue;
                }
                let Some(ray) = rays.ray(context.pixel, z, || context) else { continue };
                let Some(board_depth) = plane.depth(ray) else { continue };
                let point = plane.to_board(ray, board_depth);
                let size = SHARE_OF_NOISE * noise.depth.sigma_rho(1.0 / z) * z * z;
                *raw = ((z + size * pattern.sign([u, v], [point.x, point.y], period)) / unit_mm).round() as u16;
            }
        }
        write_depth(&file, &depth)?;
    }
    Ok(())
}
