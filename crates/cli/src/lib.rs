//! The command line: one file per command.

mod apply;
mod apply_resume;
mod apply_stream;
mod calibrate;
mod common;
mod compare;
mod completions;
mod demo;
mod detect;
mod diagnose;
mod evaluate;
mod export;
mod man;
mod progress;
mod recording;
mod session;
mod simulate;
mod voice;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

use common::Failure;
use depthcal_model::Register;
use serde_json::{Value, json};
use session::Session;

/// Calibrates depth cameras: intrinsics, lens, depth distortion and poses in one joint adjustment.
///
/// A dataset is a folder with a dataset.toml that declares the board, the images and the depth
/// images. Without captures of your own, `depthcal demo` makes some and shows the whole way.
#[derive(Debug, Parser)]
#[command(name = "depthcal", version, verbatim_doc_comment, max_term_width = 120, after_help = GUIDE)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Number of threads; RAYON_NUM_THREADS is respected too. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    /// Writes the result as JSON to standard output; everything else goes to standard error.
    #[arg(long, global = true)]
    json: bool,
    /// Says more about what is done (twice: even more).
    #[arg(long, short, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

/// What to do in which order, and what exit codes mean.
const GUIDE: &str = "\
From captures to corrected depth:
  depthcal detect captures/                        is the board found in every image?
  depthcal calibrate captures/ --cross-validate 3 --out result/
  depthcal diagnose captures/ --out result/        what does the model lack? adds it
  depthcal evaluate result/calibration.json other-captures/ --out check/
  depthcal apply result/calibration.json depth/ --out corrected/ --cloud
Every --out folder receives the command's JSON file and a report.html; open that first.

Exit codes:
  0  done
  1  the input or the arguments are at fault, and what to do about it
  2  the fit cannot be trusted (not converged, parameters undetermined, folded), and why

Environment:
  DEPTHCAL_CACHE     folder for detections (default: the user's cache folder)
  DEPTHCAL_LOG       what to log, such as info or depthcal=debug (as --verbose)
  RAYON_NUM_THREADS  number of threads (as --threads)
  NO_COLOR           no colours, whatever the terminal";

#[derive(Debug, Subcommand)]
enum Command {
    Detect(detect::Detect),
    Calibrate(calibrate::Calibrate),
    Diagnose(diagnose::Diagnose),
    Evaluate(evaluate::Evaluate),
    Compare(compare::Compare),
    Apply(apply::Apply),
    Export(export::Export),
    Simulate(simulate::Simulate),
    Demo(demo::Demo),
    Completions(completions::Completions),
    Man(man::ManPage),
}

impl Command {
    fn name(&self) -> &'static str {
        match self {
            Command::Detect(_) => "detect",
            Command::Calibrate(_) => "calibrate",
            Command::Diagnose(_) => "diagnose",
            Command::Evaluate(_) => "evaluate",
            Command::Compare(_) => "compare",
            Command::Apply(_) => "apply",
            Command::Export(_) => "export",
            Command::Simulate(_) => "simulate",
            Command::Demo(_) => "demo",
            Command::Completions(_) => "completions",
            Command::Man(_) => "man",
        }
    }

    /// Runs the command; gives what `--json` writes.
    fn run(&self, session: &Session) -> Result<Value, Failure> {
        match self {
            Command::Detect(command) => command.run(session),
            Command::Calibrate(command) => command.run(session),
            Command::Diagnose(command) => command.run(session),
            Command::Evaluate(command) => command.run(session),
            Command::Compare(command) => command.run(session),
            Command::Apply(command) => command.run(session),
            Command::Export(command) => command.run(),
            Command::Simulate(command) => command.run(),
            Command::Demo(command) => command.run(session),
            Command::Completions(command) => command.run(),
            Command::Man(command) => command.run(),
        }
    }
}

/// Parses the process' arguments, runs the command with the pieces of `register`, and says with the exit code how it went.
pub fn run(register: Register) -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            let _ = error.print();
            return if error.use_stderr() { ExitCode::from(1) } else { ExitCode::SUCCESS };
        }
    };
    let level = ["warn", "info", "debug"][usize::from(arguments.verbose.min(2))];
    let filter = EnvFilter::try_from_env("DEPTHCAL_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(voice::coloured())
        .with_target(false)
        .without_time()
        .init();
    if let Some(threads) = arguments.threads {
        if threads == 0 {
            voice::complaint("error", 1, "--threads is 0; give at least 1");
            return ExitCode::from(1);
        }
        // Fails only where the pool exists already, which nothing before this makes.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    }
    voice::keep_stdout_for_json(arguments.json);
    let name = arguments.command.name();
    let (code, mut value) = match arguments.command.run(&Session::new(register)) {
        Ok(value) => (0, value),
        Err(failure) => {
            let (kind, code, message) = match failure {
                Failure::Input(message) => ("error", 1, message),
                Failure::Untrusted(message) => ("the fit cannot be trusted", 2, message),
            };
            voice::complaint(kind, code, &message);
            (code, json!({ "error": message }))
        }
    };
    if !value.is_null() {
        value["command"] = json!(name);
        value["exit_code"] = json!(code);
        voice::result(&value);
    }
    ExitCode::from(code)
}
