//! Measured data, which are not part of the repository. A test that lacks its data passes, but prints a line that begins with
//! SKIPPED, and `make test` counts these tests.
#![allow(dead_code, reason = "not every test uses all of it")]

use std::io::Write;
use std::path::PathBuf;

/// A file or folder of the measured data. Where it does not exist the test is reported as [`skipped`]. The data are in the folder
/// `DEPTHCAL_DATA`, by default `../shared/data` relative to the workspace.
pub fn measured(name: &str) -> Option<PathBuf> {
    let workspace = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let workspace = workspace.ancestors().find(|folder| folder.join("Cargo.lock").exists()).unwrap_or(&workspace);
    let data = std::env::var_os("DEPTHCAL_DATA").map_or_else(|| workspace.join("../shared/data"), PathBuf::from);
    let path = data.join(name);
    if path.exists() {
        return Some(path);
    }
    skipped(&format!("{} is not there; set DEPTHCAL_DATA to the folder of measured data", path.display()));
    None
}

/// Reports that the present test was not run, with the reason. It writes to the standard error of the process, since `cargo test`
/// hides what a passing test prints, and appends to the file that `DEPTHCAL_SKIPPED` names.
pub fn skipped(reason: &str) {
    let thread = std::thread::current();
    let line = format!("SKIPPED {} of {}: {reason}\n", thread.name().unwrap_or("a test"), env!("CARGO_PKG_NAME"));
    // The line feed before it ends a line that the test harness may have begun.
    std::io::stderr().lock().write_all(format!("\n{line}").as_bytes()).expect("standard error");
    if let Some(list) = std::env::var_os("DEPTHCAL_SKIPPED") {
        let file = std::fs::OpenOptions::new().create(true).append(true).open(list);
        file.and_then(|mut f| f.write_all(line.as_bytes())).expect("the list of skipped tests");
    }
}
