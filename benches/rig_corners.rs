//! The image part of a rig of two cameras, for comparison with other programs (`benches/rig_peers.py`).
//!
//!     cargo run --release -p depthcal-benches --bin rig_corners -- simulate FRAMES FILE
//!     cargo run --release -p depthcal-benches --bin rig_corners -- fit FILE [--threads N] [--repeats N]
//!
//! `simulate` writes the corners of a chessboard as an infrared and a colour camera see it, those that both see, in single
//! precision. `fit` prints one line of JSON: `walls` and `cpus`, s, from corners to covariance; `alone`, s, of which the cameras
//! alone take; and of plain least squares on the same corners, without a loss, the optimum: `rms` over the corners of both
//! cameras, px, `pinhole`, `lens`, `rotation` and `translation_mm` of the second camera from the first, `boards`, the poses of
//! the boards in the first as rotation vector and translation in mm, and `adjust` and `adjust_cpus`, the times of that adjustment
//! alone from a start one per cent off.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::collections::BTreeSet;
use std::error::Error;
use std::time::Instant;

use depthcal_calibration::adjust::adjustment::Adjustment;
use depthcal_calibration::calibrate::calibrate_image;
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::observe::{CameraCapture, Capture};
use depthcal_calibration::observe::{CameraFrames, DetectedFrame, MarkerObservation, MeasuredDepth, RawFrame};
use depthcal_calibration::rig_simulated::rig_capture;
use depthcal_model::{Pattern, Target};
use depthcal_simulate::{self as simulate, Board, Kind, PointOptions, RigCamera, RigSimulation};
use serde_json::{Value, json};

const COLUMNS: usize = 10;
const ROWS: usize = 7;
const SPACING_MM: f64 = 20.0;
/// Fewest corners of a frame that both cameras see.
const FEWEST: usize = 20;
/// Standard deviation of corners in plain least squares, px: residuals are far within the quadratic part of the loss.
const WIDE_SIGMA_PX: f64 = 10.0;

fn simulated(frames: usize) -> Result<Value, Box<dyn Error>> {
    let mut cameras = Vec::new();
    for name in ["infrared", "colour"] {
        cameras.push(RigCamera::usual(name, 1)?.ok_or("a camera without a usual form")?);
    }
    let board = Board::new(simulate::Pattern::Chessboard, COLUMNS, ROWS, SPACING_MM);
    let rig = RigSimulation::new(cameras, Kind::General(1), 1).board(board).frames(frames);
    let capture = rig_capture(&rig.observe_points(&PointOptions::default())?);
    let size = |c: &CameraCapture| [c.capture.width, c.capture.height];
    let mut written = Vec::new();
    for frame in &capture.cameras[0].capture.frames {
        let Some(other) = capture.cameras[1].capture.frames.iter().find(|f| f.name == frame.name) else { continue };
        let indices = |f: &DetectedFrame| f.markers.iter().map(|m| m.index).collect::<BTreeSet<usize>>();
        let both: Vec<usize> = indices(frame).intersection(&indices(other)).copied().collect();
        if both.len() < FEWEST {
            continue;
        }
        let pixels = |f: &DetectedFrame| -> Vec<[f64; 2]> {
            let shared = f.markers.iter().filter(|m| both.contains(&m.index));
            shared.map(|m| m.pixel.map(|c| f64::from(c as f32))).collect()
        };
        written.push(json!({ "name": frame.name, "index": both, "pixels": [pixels(frame), pixels(other)] }));
    }
    let sizes: Vec<[usize; 2]> = capture.cameras.iter().map(size).collect();
    Ok(json!({ "columns": COLUMNS, "rows": ROWS, "spacing_mm": SPACING_MM, "sizes": sizes, "frames": written }))
}

/// A number of a file, and lists of them.
fn number(value: &Value) -> Result<f64, Box<dyn Error>> {
    value.as_f64().ok_or_else(|| format!("{value} is no number").into())
}

fn list(value: &Value) -> Result<&[Value], Box<dyn Error>> {
    value.as_array().map(Vec::as_slice).ok_or_else(|| format!("{value} is no list").into())
}

fn read(file: &Value) -> Result<Capture, Box<dyn Error>> {
    let count = |name: &str| Ok::<_, Box<dyn Error>>(number(&file[name])? as usize);
    let target = Target {
        pattern: Pattern::Chessboard,
        columns: count("columns")?,
        rows: count("rows")?,
        spacing_mm: number(&file["spacing_mm"])?,
    };
    let mut cameras = Vec::new();
    for (camera, name) in ["infrared", "colour"].into_iter().enumerate() {
        let mut frames = Vec::new();
        for frame in list(&file["frames"])? {
            let mut markers = Vec::new();
            for (index, pixel) in list(&frame["index"])?.iter().zip(list(&frame["pixels"][camera])?) {
                let pixel = [number(&pixel[0])?, number(&pixel[1])?];
                markers.push(MarkerObservation { index: number(index)? as usize, pixel, std_px: 1.0 });
            }
            let name = frame["name"].as_str().unwrap_or_default().to_owned();
            let raw = RawFrame { name, depth: MeasuredDepth::None, ..RawFrame::default() };
            frames.push(DetectedFrame { raw, markers, ..DetectedFrame::default() });
        }
        let size = &file["sizes"][camera];
        let capture = CameraFrames {
            name: name.to_owned(),
            target: target.clone(),
            width: number(&size[0])? as usize,
            height: number(&size[1])? as usize,
            depth_unit_mm: None,
            disparity: None,
            technology: None,
            frames,
            dropped: Vec::new(),
        };
        cameras.push(CameraCapture::of(name, capture));
    }
    Ok(Capture { name: "corners".to_owned(), cameras })
}

/// Processor time of the process, s: user and system, all threads.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Behind the name in brackets; utime and stime are the 14th and 15th fields, in hundredths.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|t| t.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}

fn fit(capture: &Capture, repeats: usize) -> Result<Value, Box<dyn Error>> {
    let options = CalibrateOptions { lens: Some("brown-conrady:full".to_owned()), ..CalibrateOptions::default() };
    let (mut walls, mut cpus, mut alone) = (Vec::new(), Vec::new(), Vec::new());
    let (mut adjust, mut adjust_cpus) = (Vec::new(), Vec::new());
    let mut last = Value::Null;
    for _ in 0..repeats {
        let begin = Instant::now();
        for camera in &capture.cameras {
            calibrate_image(&camera.capture, &options.of(camera)?)?;
        }
        alone.push(begin.elapsed().as_secs_f64());
        let (begin, cpu) = (Instant::now(), processor_s());
        let fitted = calibrate(capture, &options)?;
        walls.push(begin.elapsed().as_secs_f64());
        cpus.push(processor_s() - cpu);
        let mut state = fitted.state;
        for camera in &mut state.cameras {
            camera.noise.pixel_sigma = WIDE_SIGMA_PX;
            let theta: Vec<f64> = camera.camera.theta().iter().map(|value| 1.01 * value).collect();
            camera.camera = camera.camera.with_theta(&theta);
        }
        let (begin, cpu) = (Instant::now(), processor_s());
        let solved = Adjustment::of_state(&state, true)?.solve_within(1e-13)?;
        adjust.push(begin.elapsed().as_secs_f64());
        adjust_cpus.push(processor_s() - cpu);
        let squares: f64 =
            solved.cameras.iter().flat_map(|c| &c.image_residuals).map(|r| (r * WIDE_SIGMA_PX).powi(2)).sum();
        let corners = solved.cameras.iter().map(|c| c.image_residuals.len() / 2).sum::<usize>();
        let place = &solved.cameras[1].camera_from_rig;
        let rotation = place.rotation.scaled_axis();
        let boards = solved.rig_from_board.iter().map(|pose| (pose.rotation.scaled_axis(), pose.translation.vector));
        let boards: Vec<[f64; 6]> = boards.map(|(r, t)| [r.x, r.y, r.z, t.x, t.y, t.z]).collect();
        let theta: Vec<Vec<f64>> = solved.cameras.iter().map(|camera| camera.camera.theta()).collect();
        last = json!({
            "boards": boards,
            "rms": (squares / corners as f64).sqrt(),
            "frames": state.frames.len(),
            "iterations": solved.report.iterations,
            "lens": theta.iter().map(|t| t[..5].to_vec()).collect::<Vec<_>>(),
            "pinhole": theta.iter().map(|t| t[5..9].to_vec()).collect::<Vec<_>>(),
            "rotation": [rotation.x, rotation.y, rotation.z],
            "translation_mm": [place.translation.x, place.translation.y, place.translation.z],
        });
    }
    let times = [("walls", walls), ("cpus", cpus), ("alone", alone), ("adjust", adjust), ("adjust_cpus", adjust_cpus)];
    for (name, values) in times {
        last[name] = json!(values);
    }
    Ok(last)
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let option =
        |name: &str| words.iter().position(|w| w == name).and_then(|i| words.get(i + 1)?.parse::<usize>().ok());
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["simulate", frames, file] => Ok(std::fs::write(file, simulated(frames.parse()?)?.to_string())?),
        ["fit", file, ..] => {
            if let Some(threads) = option("--threads") {
                rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
            }
            let capture = read(&serde_json::from_str(&std::fs::read_to_string(file)?)?)?;
            println!("{}", fit(&capture, option("--repeats").unwrap_or(1))?);
            Ok(())
        }
        _ => Err("say simulate FRAMES FILE, or fit FILE".into()),
    }
}
