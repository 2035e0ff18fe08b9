//! Prints every violation of the workspace's structure: `cargo run -p depthcal-structure --example structure [FOLDER]`.

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = std::env::args_os().nth(1).map_or_else(own, PathBuf::from);
    match depthcal_structure::check_workspace(&root) {
        Ok(violations) => {
            violations.iter().for_each(|v| println!("{}", v.trim_end()));
            println!("{} violations", violations.len());
            if violations.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
