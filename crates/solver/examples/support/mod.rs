//! Arguments, timing and the line of JSON of the benchmark examples.

use std::error::Error;
use std::time::Instant;

use depthcal_solver::{Graph, Options, Solution, Values, minimize};

/// Solves the problem that `read` makes of the file on the command line and prints one line of JSON.
///
/// `wall` is the time of the solve alone, structure included, in seconds; `build` that from parsed numbers to a graph;
/// `cost` is ½ Σ ρ.
pub fn run<P>(
    name: &str,
    parse: impl FnOnce(&str) -> Result<P, Box<dyn Error>>,
    build: impl FnOnce(P) -> Result<(Graph, Values), Box<dyn Error>>,
    configure: impl FnOnce(&mut Options),
) -> Result<Solution, Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.first().ok_or_else(|| format!("usage: {name} FILE [--threads N] [--report]"))?;
    let threads = match arguments.iter().position(|a| a == "--threads") {
        Some(i) => arguments.get(i + 1).ok_or("--threads needs a number")?.parse()?,
        None => 0,
    };
    let mut options = Options { threads, ..Options::default() };
    configure(&mut options);
    let begin = Instant::now();
    let problem = parse(path)?;
    let parsing = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let (graph, values) = build(problem)?;
    let building = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let solution = minimize(&graph, values, &options)?;
    let wall = begin.elapsed().as_secs_f64();
    let report = &solution.report;
    if arguments.iter().any(|a| a == "--report") {
        eprintln!("{report}");
    }
    println!(
        "{}",
        serde_json::json!({
            "wall": wall, "cost0": report.cost0, "cost": report.cost, "iters": report.iterations,
            "converged": report.converged, "seconds": report.seconds, "build": building, "parse": parsing,
            "rss_mb": peak_memory(), "linear_solver": report.linear_solver.to_string(), "chunks": report.linear_solver.chunks,
            "threads": threads,
        })
    );
    Ok(solution)
}

/// Largest resident memory of the process in MB, where the system tells.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}
