//! Pose graphs in the plane and in space.
//!
//! `cargo run --release --example pose_graph -- FILE --threads N` reads a file of g2o (`VERTEX_SE2`, `EDGE_SE2`,
//! `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT`, `FIX`) and prints one line of JSON. Where nothing is fixed, the first pose is.
//!
//! `cargo run --release --example pose_graph -- --generate KIND N FILE` writes a synthetic file instead, with N poses or some
//! more: `manhattan` (a walk along streets), `sphere` (a spiral around a sphere) or `torus` (a coil around a ring), with noise
//! in the measurements and a start that is their chain from the first pose on.

#[path = "support/pose_factors.rs"]
mod pose_factors;
mod support;
#[path = "support/synthetic.rs"]
mod synthetic;

use std::error::Error;

use depthcal::io::G2oGraph;

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
