//! The joint adjustment with a field of very many nodes: time and memory.
//!
//! `cargo run --release -p depthcal-studies --bin large_field -- [FRAMES] [SAMPLES PER FRAME] [COLUMNS] [ROWS] [BINS]`; without
//! arguments 100 frames of 20 000 depth residuals each, near boards, and a multiplier map of 80×60×5 nodes.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::time::Instant;

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::simulated;
use depthcal_simulate::{Board, CameraTruth, Effect, Kind, Pattern, PointOptions, Simulation};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut numbers = std::env::args().skip(1).map(|a| a.parse::<usize>());
    let mut next = |default: usize| numbers.next().unwrap_or(Ok(default));
    let (frames, samples) = (next(100)?, next(20_000)?);
    let (columns, rows, bins) = (next(80)?, next(60)?, next(5)?);
    let effect = Effect::new("smooth_map", 6.0)?;
    // A board that fills more of the image than the thesis' does: that has too few pixels.
    let board = Board::new(Pattern::SymmetricCircles { circle_diameter_mm: 12.0 }, 9, 7, 40.0);
    let simulation =
        Simulation::new(CameraTruth::published(1)?, Kind::Plywood1, &[effect], 1).frames(frames).board(board);
    let observed = simulation.observe_points(&PointOptions { depth_samples: samples, ..PointOptions::default() })?;
    let capture = simulated::capture(&observed);
    let total: usize = capture.frames.iter().map(|f| f.depth_pixels().len()).sum();
    let model = format!("projective+multiplier@columns={columns}@rows={rows}@bins={bins}");
    println!("{model}: {frames} frames, {total} depth residuals");
    let start = Instant::now();
    let result = calibrate_camera(&capture, &CameraOptions { model: model.parse()?, ..CameraOptions::default() })?;
    let seconds = start.elapsed().as_secs_f64();
    for field in &result.smoothness.fields {
        println!("{}: {} nodes with data, {} without", field.field, field.nodes, field.untouched);
    }
    println!("{} iterations, {}; depth {:?} mm rms", result.iterations, result.termination, result.depth_rms_mm);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or("VmHWM: unknown");
    println!("{seconds:.1} s; {peak}");
    Ok(())
}
