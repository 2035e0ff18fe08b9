//! Arguments, timing and the line of JSON of the benchmark examples.
#![allow(dead_code, reason = "not every example uses all of it")]

use std::error::Error;
use std::time::Instant;

use depthcal_solver::{Graph, Options, Report, Solution, Values, minimize};
use serde_json::{Value, json};

/// The command line: a file, then options.
pub struct Arguments(Vec<String>);

impl Arguments {
    /// Those of the process.
    pub fn read() -> Self {
        Self(std::env::args().skip(1).collect())
    }

    /// The file, or an error that tells the usage.
    pub fn file(&self, usage: &str) -> Result<&str, String> {
        self.0.first().map(String::as_str).ok_or_else(|| format!("usage: {usage}"))
    }

    /// Whether an option is there.
    pub fn has(&self, option: &str) -> bool {
        self.0.iter().any(|a| a == option)
    }

    /// The word after an option.
    pub fn after(&self, option: &str) -> Result<Option<&str>, String> {
        match self.0.iter().position(|a| a == option) {
            Some(i) => self.0.get(i + 1).map(|word| Some(word.as_str())).ok_or(format!("{option} needs a value")),
            None => Ok(None),
        }
    }

    /// The largest number of iterations, if it is given.
    pub fn max_iterations(&self) -> Result<u64, Box<dyn Error>> {
        let default = Options::default().max_iterations;
        Ok(self.after("--max-iterations")?.map_or(Ok(default), str::parse)?)
    }

    /// The number of threads, 0 for as many as there are cores.
    pub fn threads(&self) -> Result<usize, Box<dyn Error>> {
        Ok(self.after("--threads")?.map_or(Ok(0), str::parse)?)
    }
}

/// Solves the problem that `build` makes of the file on the command line and prints one line of JSON.
///
/// `wall` is the time of the solve alone, structure included, in seconds; `build` that from parsed numbers to a graph;
/// `cost` is ½ Σ ρ.
pub fn run<P>(
    name: &str,
    parse: impl FnOnce(&str) -> Result<P, Box<dyn Error>>,
    build: impl FnOnce(P) -> Result<(Graph, Values), Box<dyn Error>>,
    configure: impl FnOnce(&mut Options),
) -> Result<Solution, Box<dyn Error>> {
    let arguments = Arguments::read();
    let path = arguments.file(&format!("{name} FILE [--threads N] [--max-iterations N] [--report]"))?;
    let mut options = Options { threads: arguments.threads()?, ..Options::default() };
    options.max_iterations = arguments.max_iterations()?;
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
    if arguments.has("--report") {
        eprintln!("{}", solution.report);
    }
    let more = json!({"wall": wall, "build": building, "parse": parsing, "threads": options.threads});
    println!("{}", line(&solution.report, more));
    Ok(solution)
}

/// The line of JSON: what the report says, memory, and `more`.
pub fn line(report: &Report, more: Value) -> Value {
    let mut line = json!({
        "cost0": report.cost0, "cost": report.cost, "iters": report.iterations, "converged": report.converged,
        "seconds": report.seconds, "rss_mb": peak_memory(), "linear_solver": report.linear_solver.to_string(),
        "chunks": report.linear_solver.chunks,
    });
    if let (Some(line), Value::Object(more)) = (line.as_object_mut(), more) {
        line.extend(more);
    }
    line
}

/// Largest resident memory of the process in MB, where the system tells.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}
