//! A board in front of a depth camera: image points and depths of many frames, joint adjustment of the camera and all poses.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

#[path = "support/board.rs"]
mod board;
mod support;

use std::error::Error;

use board::{Observation, Problem, parse};
use depthcal_solver::{Batch, Graph, Noise, Values};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3, Vector4};

fn build(problem: Problem) -> Result<(Graph, Values), Box<dyn Error>> {
    let Problem { initial, sigmas, board, frames } = problem;
    let mut values = Values::new();
    let pinhole = values.insert(Vector4::from_column_slice(&initial[..4]));
    let lens = values.insert(SVector::<f64, 5>::from_column_slice(&initial[4..9]));
    let depth = values.insert(Vector4::from_column_slice(&initial[9..]));
    let mut batch = Batch::new("points").with_noise(Noise::diagonal([sigmas[0], sigmas[0], sigmas[1]])?);
    for ([r1, r2, r3, t1, t2, t3], points) in frames {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(r1, r2, r3));
        let pose = values.insert(Isometry3::from_parts(Translation3::new(t1, t2, t3), rotation));
        for (board, [u, v, z]) in board.iter().zip(points) {
            batch.push(Observation { board: *board, observed: [u, v, 1.0 / z] }, (pose, pinhole, lens, depth));
        }
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    Ok((graph, values))
}

fn main() -> Result<(), Box<dyn Error>> {
    support::run("board", parse, build, |_| {})?;
    Ok(())
}
