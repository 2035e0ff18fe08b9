//! The problem of `board`, frame by frame, as in a live calibration.
//!
//! `cargo run --release -p depthcal-solver --example growing_board -- FILE [--threads N]` adds the frames of a file one after the
//! other to an incremental session and prints one line of JSON: `add_ms` is the median time of the last ten additions, `most_ms`
//! the longest of all, `take_back_ms` that of removing a frame, `settle_ms` that of settling, and `cost` the cost after it.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

#[path = "support/board.rs"]
mod board;
mod support;

use std::error::Error;
use std::time::Instant;

use board::{Observation, parse};
use depthcal_solver::{Batch, Graph, IncrementalOptions, IncrementalSession, Noise, Values};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3, Vector4};
use support::Arguments;

fn milliseconds<T>(f: impl FnOnce() -> T) -> (f64, T) {
    let begin = Instant::now();
    let result = f();
    (1e3 * begin.elapsed().as_secs_f64(), result)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::read();
    let problem = parse(arguments.file("growing_board FILE [--threads N]")?)?;
    let mut shared = Values::new();
    let pinhole = shared.insert(Vector4::from_column_slice(&problem.initial[..4]));
    let lens = shared.insert(SVector::<f64, 5>::from_column_slice(&problem.initial[4..9]));
    let depth = shared.insert(Vector4::from_column_slice(&problem.initial[9..]));
    let noise = Noise::diagonal([problem.sigmas[0], problem.sigmas[0], problem.sigmas[1]])?;
    let options =
        IncrementalOptions { threads: arguments.threads()?.max(1), hold_until: 5, ..IncrementalOptions::default() };
    let mut session = IncrementalSession::new(shared, &Graph::new(), options)?;
    let (mut times, mut frames) = (Vec::new(), Vec::new());
    for ([r1, r2, r3, t1, t2, t3], points) in &problem.frames {
        let (time, added) = milliseconds(|| {
            session.add(|values, graph| {
                let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(*r1, *r2, *r3));
                let pose = values.insert(Isometry3::from_parts(Translation3::new(*t1, *t2, *t3), rotation));
                let mut batch = Batch::new("points").with_noise(noise.clone());
                for (board, [u, v, z]) in problem.board.iter().zip(points) {
                    let observed = [*u, *v, 1.0 / z];
                    batch.push(Observation { board: *board, observed }, (pose, pinhole, lens, depth));
                }
                graph.add_batch(batch);
            })
        });
        frames.push(added?.0);
        times.push(time);
    }
    let linearizations = session.linearizations();
    let before = session.cost();
    let (settling, converged) = milliseconds(|| session.settle());
    let (converged, cost) = (converged?, session.cost());
    let (taking_back, removed) = milliseconds(|| session.remove(frames[0]));
    removed?;
    let longest = times.iter().copied().fold(0.0, f64::max);
    let last = &mut times[frames.len().saturating_sub(10)..];
    last.sort_unstable_by(f64::total_cmp);
    println!(
        "{}",
        serde_json::json!({
            "frames": frames.len(), "add_ms": last[last.len() / 2], "slowest_of_last_ten_ms": last[last.len() - 1],
            "most_ms": longest, "linearizations": linearizations, "cost_before": before, "settle_ms": settling,
            "cost": cost, "converged": converged, "take_back_ms": taking_back,
        })
    );
    Ok(())
}
