//! Other programs as oracles, by way of Python: the interpreter that `DEPTHCAL_PYTHON` names, else `python3`, else the system's
//! own, for which `make setup` installs numpy and pytest. A test whose modules are not there passes, but prints a line that
//! begins with SKIPPED.
#![allow(dead_code, reason = "not every test uses all of it")]

#[path = "measured.rs"]
mod measured;

use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

#[allow(unused_imports, reason = "not every test uses all of it")]
pub use measured::{measured, skipped};

/// An interpreter that has what a test needs.
pub struct Python {
    program: PathBuf,
}

/// The first interpreter that has all `modules`; where there is none the test is reported as skipped.
pub fn with_modules(modules: &[&str]) -> Option<Python> {
    let programs = match std::env::var_os("DEPTHCAL_PYTHON") {
        Some(program) => vec![PathBuf::from(program)],
        None => ["python3", "/usr/bin/python3"].map(PathBuf::from).to_vec(),
    };
    let imports = format!("import {}", modules.join(", "));
    let has_all = |program: &PathBuf| {
        Command::new(program).args(["-c", &imports]).output().is_ok_and(|output| output.status.success())
    };
    let program = programs.iter().find(|program| has_all(program)).cloned();
    if program.is_none() {
        skipped(&format!("{} has not all of {}", programs[0].display(), modules.join(", ")));
    }
    Some(Python { program: program? })
}

impl Python {
    /// The interpreter, to be run in another way.
    pub fn command(&self) -> Command {
        Command::new(&self.program)
    }

    /// Runs a script with arguments; returns what it prints. Panics, with what it complains of, where it fails.
    pub fn run(&self, code: &str, arguments: &[&Path]) -> String {
        let output = Command::new(&self.program).arg("-c").arg(code).args(arguments).output().expect("the interpreter");
        assert!(output.status.success(), "{code}\n{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

/// An empty folder of a test for its files, which is removed at its end.
pub struct Scratch(TempDir);

/// The folder of the test with this name.
pub fn folder(name: &str) -> Scratch {
    Scratch(tempfile::Builder::new().prefix(&format!("depthcal-{name}-")).tempdir().expect("a folder"))
}

impl Deref for Scratch {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}
