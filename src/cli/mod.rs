//! The command line: one file per command.

mod apply;
mod apply_resume;
mod apply_stream;
mod calibrate;
mod common;
mod compare;
mod demo;
mod detect;
mod diagnose;
mod evaluate;
mod export;
mod simulate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

use common::Failure;

/// Calibrates depth cameras: intrinsics, lens, depth distortion and poses in one joint adjustment.
///
/// A dataset is a folder with a dataset.toml that declares the board, the images and the depth
/// images. Typical use:
///
///   depthcal calibrate captures/ --out result/      fit a camera
///   depthcal diagnose captures/ --out result/       find what its model lacks, and add it
///   depthcal evaluate result/calibration.json other-captures/ --out check/
///   depthcal apply result/calibration.json depth/*.png --out corrected/ --cloud
///
/// Exit codes: 0 done; 1 the input or the arguments are at fault; 2 the fit cannot be trusted
/// (not converged, parameters undetermined, folded), and why.
#[derive(Debug, Parser)]
#[command(version, verbatim_doc_comment, max_term_width = 120)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Number of threads; RAYON_NUM_THREADS is respected too. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    /// Says more about what is done (twice: even more).
    #[arg(long, short, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

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
}

/// Parses the arguments, runs the command, and says with the exit code how it went.
pub fn run() -> ExitCode {
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
        .with_target(false)
        .without_time()
        .init();
    if let Some(threads) = arguments.threads {
        if threads == 0 {
            eprintln!("error: --threads is 0; give at least 1");
            return ExitCode::from(1);
        }
        // Fails only where the pool exists already, which nothing before this makes.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    }
    let result = match arguments.command {
        Command::Detect(command) => command.run(),
        Command::Calibrate(command) => command.run(),
        Command::Diagnose(command) => command.run(),
        Command::Evaluate(command) => command.run(),
        Command::Compare(command) => command.run(),
        Command::Apply(command) => command.run(),
        Command::Export(command) => command.run(),
        Command::Simulate(command) => command.run(),
        Command::Demo(command) => command.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(message)) => {
            eprintln!("error: {message}");
            ExitCode::from(1)
        }
        Err(Failure::Untrusted(message)) => {
            eprintln!("the fit cannot be trusted: {message}");
            ExitCode::from(2)
        }
    }
}
