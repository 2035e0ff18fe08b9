//! A program with a depth model of its own, `examples/own_depth_model.rs`, is a full `depthcal`: its model takes part in every
//! command.

#![cfg(all(feature = "cli", feature = "detect"))]

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::{self, Folder, stderr, stdout};
use serde_json::Value;

const MODEL: &str = "projective+cubic_vignette";

/// Whether a program is newer than each of its source files. Cargo writes their list to `PROGRAM.d`, in the program's folder.
fn is_up_to_date(program: &Path) -> bool {
    let modified = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified()).ok();
    let Ok(list) = std::fs::read_to_string(program.with_extension("d")) else { return false };
    let Some((_, sources)) = list.split_once(": ") else { return false };
    let built = modified(program);
    // A folder with spaces in its name is not found, and the program built once more.
    built.is_some()
        && sources.split_whitespace().all(|source| modified(Path::new(source)).is_some_and(|m| Some(m) < built))
}

/// The example's binary, built with the profile of this test. Cargo builds it for `cargo test`, but not for
/// `cargo test --test suite`. It is built here only then: other features than those of the whole workspace compile most of it
/// again.
fn example() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let profile = test.ancestors().nth(2).unwrap();
    let program = profile.join("examples/own_depth_model").with_extension(std::env::consts::EXE_EXTENSION);
    if is_up_to_date(&program) {
        return program;
    }
    let name = match profile.file_name().unwrap().to_str().unwrap() {
        "debug" => "dev",
        name => name,
    };
    let status = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--example", "own_depth_model", "--profile", name, "--target-dir"])
        .arg(profile.parent().unwrap())
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()
        .unwrap();
    assert!(status.success());
    program
}

/// Runs the example with `--json`; returns its result and its messages.
fn run(program: &Path, cache: &Path, arguments: &[&str]) -> (Value, String) {
    let mut command = Command::new(program);
    command.args(arguments).arg("--json").env("DEPTHCAL_CACHE", cache);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    (serde_json::from_str(&stdout(&output)).unwrap(), stderr(&output))
}

fn names<'a>(list: &'a Value, key: &str) -> Vec<&'a str> {
    list.as_array().unwrap().iter().map(|v| v[key].as_str().unwrap()).collect()
}

#[test]
fn a_model_from_outside_takes_part_in_every_command() {
    let (program, folder) = (example(), Folder::new());
    let cache = folder.path("cache");
    let run = |arguments: &[&str]| run(&program, &cache, arguments);
    let (captures, result) = (folder.arg("captures"), folder.arg("result"));
    run(&["simulate", "--frames", "8", "--out", &captures]);

    let (value, words) = run(&["calibrate", &captures, "--model", MODEL, "--out", &result]);
    let pieces = &value["calibration"]["camera"]["pieces"];
    let piece = pieces.as_array().unwrap().iter().find(|p| p["name"] == "cubic_vignette").unwrap();
    let s = &piece["parameters"][0];
    assert!(s["name"] == "s" && s["std_dev"].as_f64().unwrap() > 0.0, "{s}");
    // The simulated camera has no such error.
    assert!(s["value"].as_f64().unwrap().abs() < 6.0 * s["std_dev"].as_f64().unwrap(), "{s}");
    assert!(words.contains("cubic_vignette\n  s "), "{words}");
    let report = std::fs::read_to_string(folder.path("result/report.html")).unwrap();
    assert!(report.contains("cubic vignette"));

    let models = format!("projective,{MODEL}");
    let quick = ["--learning", "0", "--folds", "2"];
    let out = folder.arg("compared");
    let arguments = [&["compare", &captures, "--models", &models, "--out", &out], &quick[..]].concat();
    let (value, _) = run(&arguments);
    let compared = &value["comparison"]["models"];
    assert!(names(compared, "model").contains(&MODEL), "{compared}");
    assert!(
        compared.as_array().unwrap().iter().all(|m| m["held_out"]["dot_error_mm"]["mean"].is_number()),
        "{compared}"
    );

    let (value, _) = run(&["diagnose", &captures, "--folds", "2", "--out", &folder.arg("diagnosed")]);
    let tested = &value["diagnosis"]["rounds"][0]["effects"];
    assert!(names(tested, "effect").contains(&"cubic_vignette"), "{tested}");

    let calibration = format!("{result}/calibration.json");
    let (value, _) = run(&["evaluate", &calibration, &captures, "--out", &folder.arg("evaluated")]);
    let rms = &value["datasets"][0]["depth_rms_mm"];
    assert!(rms["after"].as_f64().unwrap() < rms["before"].as_f64().unwrap(), "{rms}");

    let (value, _) = run(&["apply", &calibration, &captures, "--out", &folder.arg("corrected")]);
    assert!(value["frames"] == 8 && value["pixels"]["corrected"].as_u64().unwrap() > 0, "{value}");

    let camera = folder.arg("camera.yml");
    run(&["export", &calibration, "--format", "opencv", "--out", &camera]);
    assert!(std::fs::read_to_string(&camera).unwrap().contains("cubic_vignette"));
    let (value, _) = run(&["export", &calibration, "--format", "ros", "--out", &folder.arg("camera.yaml")]);
    assert!(value["warnings"].to_string().contains("cubic_vignette"), "{value}");

    // The program without that model names it.
    support::fails(["apply", &calibration, &captures, "--out", &folder.arg("other")], &["cubic_vignette"]);
}
