//! Runs the package's tests in Python against the module that Cargo has built, with whatever Python has numpy and pytest; tests
//! that need more are skipped. The wheel, the notebooks and Ray are tested by scripts/python-tests.sh.

#[path = "../../../tests/support/python.rs"]
mod python;

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX, EXE_SUFFIX};
use std::path::Path;

#[test]
fn python_tests_pass_with_the_module_that_cargo_has_built() {
    let Some(python) = python::with_modules(&["numpy", "pytest"]) else { return };
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = std::env::current_exe().expect("this program");
    let built = program.parent().expect("a folder");
    let module = built.join(format!("{DLL_PREFIX}_depthcal{DLL_SUFFIX}"));

    let folder = tempfile::tempdir().expect("a folder");
    let installed = folder.path().join("depthcal");
    std::fs::create_dir(&installed).expect("a folder");
    for file in std::fs::read_dir(package.join("python/depthcal")).expect("the package") {
        let file = file.expect("a file").path();
        if file.is_file() {
            std::fs::copy(&file, installed.join(file.file_name().expect("a name"))).expect("a copy");
        }
    }
    let name = if cfg!(windows) { "_depthcal.pyd" } else { "_depthcal.abi3.so" };
    std::fs::copy(&module, installed.join(name)).unwrap_or_else(|e| panic!("{}: {e}", module.display()));

    // The command line is built before any test is run where all of the workspace is tested.
    let command_line = built.parent().map(|target| target.join(format!("depthcal{EXE_SUFFIX}")));
    let output = python
        .command()
        .args(["-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider"])
        .args(["--ignore-glob=*test_notebooks.py", "--ignore-glob=*test_fleet.py"])
        .arg(package.join("tests"))
        .current_dir(&folder)
        .env("PYTHONPATH", folder.path())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .envs(command_line.map(|path| ("DEPTHCAL_BIN", path)))
        .output()
        .expect("the interpreter");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stderr));
    for line in said.lines().filter_map(|line| line.strip_prefix("SKIPPED ")) {
        python::skipped(line);
    }
    let passed = said.lines().last().and_then(|line| line.split_once(" passed"));
    let passed = passed.and_then(|(before, _)| before.rsplit(' ').next()?.parse::<usize>().ok());
    assert!(passed.is_some_and(|passed| passed >= 40), "fewer tests ran than are there:\n{said}");
}
