//! Pose graphs in the plane and in space.
//!
//! `cargo run --release -p depthcal-solver --example pose_graph -- FILE --threads N` reads a file of g2o (`VERTEX_SE2`,
//! `EDGE_SE2`, `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT`, `FIX`), solves it and prints one line of JSON. If the file fixes no vertex,
//! the first one is fixed.
//!
//! `cargo run --release -p depthcal-solver --example pose_graph -- --generate KIND N FILE` writes a synthetic file instead, with
//! about N poses: `manhattan` (a walk along streets), `sphere` (a spiral around a sphere) or `torus` (a coil around a ring).
//! Measurements are noisy, and the start values are the measurements chained from the first pose on.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

#[path = "support/g2o.rs"]
mod g2o;
#[path = "support/pose_factors.rs"]
mod pose_factors;
mod support;
#[path = "support/synthetic.rs"]
mod synthetic;
#[path = "support/words.rs"]
mod words;

use std::error::Error;

use g2o::G2oGraph;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [option, kind, count, path] = arguments.as_slice()
        && option == "--generate"
    {
        std::fs::write(path, synthetic::generate(kind, count.parse()?)?)?;
        return Ok(());
    }
    support::run("pose_graph", |path| Ok(G2oGraph::read(path)?), pose_factors::build, |_| {})?;
    Ok(())
}
