//! The `depthcal` command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    depthcal::cli::run(depthcal::model::Register::builtin())
}
