//! Prints every violation of the workspace's structure: `cargo run -p depthcal-structure --example structure [FOLDER]`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let workspace = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = std::env::args_os().nth(1).map_or_else(workspace, PathBuf::from);
    match depthcal_structure::check_workspace(&root) {
        Ok(report) => {
            report.postponed.iter().for_each(|v| println!("postponed: {v}"));
            report.violations.iter().for_each(|v| println!("{}", v.trim_end()));
            println!("{} violations, {} postponed", report.violations.len(), report.postponed.len());
            if report.violations.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
