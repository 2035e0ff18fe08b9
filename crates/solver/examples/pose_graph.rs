//! Pose graphs in the plane and in space.
//!
//! `cargo run --release -p depthcal-solver --example pose_graph -- FILE --threads N` reads a file of g2o (`VERTEX_SE2`,
//! `EDGE_SE2`, `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT`, `FIX`), solves it from the chordal start with SE-Sync's objective and prints
//! one line of JSON, in which `objective` is SE-Sync's. If the file fixes no vertex, the first one is fixed.
//!
//! `--start file` takes the poses of the file instead, `--start tree` measurements chained along a tree; `--objective g2o` is
//! that of g2o; `--certify` adds how far the result is from the global optimum at most; `--nielsen` damps from the beginning;
//! `--write-start PATH` and `--write PATH` write start and result as vertices of g2o.
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
use std::time::Instant;

use depthcal_solver::{Damping, Options, minimize};
use g2o::G2oGraph;
use pose_factors::{Objective, PoseGraph};
use support::Arguments;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [option, kind, count, path] = arguments.as_slice()
        && option == "--generate"
    {
        std::fs::write(path, synthetic::generate(kind, count.parse()?)?)?;
        return Ok(());
    }
    solve()
}

fn solve() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::read();
    let usage =
        "pose_graph FILE [--threads N] [--start file|tree|chordal] [--objective g2o|chordal] [--certify] [--report]";
    let path = arguments.file(usage)?;
    let objective = match arguments.after("--objective")? {
        None | Some("chordal") => Objective::Chordal,
        Some("g2o") => Objective::G2o,
        Some(_) => return Err(usage.into()),
    };
    let mut options = Options { threads: arguments.threads()?, cost_tolerance: 1e-8, ..Options::default() };
    options.max_iterations = arguments.max_iterations()?;
    if !arguments.has("--nielsen") {
        options.damping = Damping::WhenNeeded { tau: 1e-4 };
    }
    let file = G2oGraph::read(path)?;
    let begin = Instant::now();
    let mut problem = PoseGraph::new(&file, objective)?;
    let build = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    match arguments.after("--start")? {
        None | Some("chordal") => problem.start(true)?,
        Some("tree") => problem.start(false)?,
        Some("file") if !file.without_vertices => {}
        Some("file") => return Err("the file has no vertices: --start tree or chordal".into()),
        Some(_) => return Err(usage.into()),
    }
    let starting = begin.elapsed().as_secs_f64();
    if let Some(path) = arguments.after("--write-start")? {
        std::fs::write(path, problem.vertices(&file, &problem.values))?;
    }
    let begin = Instant::now();
    let solution = minimize(&problem.graph, problem.values.clone(), &options)?;
    let wall = starting + begin.elapsed().as_secs_f64();
    if let Some(path) = arguments.after("--write")? {
        std::fs::write(path, problem.vertices(&file, &solution.values))?;
    }
    if arguments.has("--report") {
        eprintln!("{}", solution.report);
    }
    let mut more = serde_json::json!({"wall": wall, "start": starting, "build": build, "threads": options.threads});
    if objective == Objective::Chordal {
        more["objective"] = (2.0 * solution.report.cost).into();
    }
    if objective == Objective::Chordal && arguments.has("--certify") {
        // The bound is best at the exact optimum, and holds for all poses.
        let exact = Options { cost_tolerance: 1e-14, max_iterations: 100, ..options };
        let certificate = problem.certify(&minimize(&problem.graph, solution.values, &exact)?.values)?;
        let objective = 2.0 * solution.report.cost;
        more["gap"] = certificate.lower_bound.map(|bound| (objective - bound) / objective).into();
    }
    println!("{}", support::line(&solution.report, more));
    Ok(())
}
