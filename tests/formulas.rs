//! Formulas in files, from end to end: simulated, fitted, compared, kept in `calibration.json`, applied and evaluated without the
//! file.

#![cfg(all(feature = "cli", feature = "detect"))]

use std::path::Path;

use crate::support::{Folder, fails, stdout, succeeds};
use depthcal::Register;
use depthcal::formula::FormulaFile;
use serde_json::Value;

/// An effect that the catalogue lacks: rows differ, and the more so the nearer the board is.
const ROW_GAIN: &str = r#"
[[effect]]
name = "row_gain"
hook = "depth"
adds_to = "inverse_depth"
of = "measured"
formula = "a * y * log(rho / rho0)"
parameters = { a = { unit = "1/mm", value = 3e-5 } }
constants = { rho0 = 0.00125 }
"#;

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&stdout(&succeeds([arguments, &["--json"]].concat()))).unwrap()
}

#[test]
fn a_formula_is_fitted_kept_and_applied_like_a_piece() {
    let folder = Folder::new();
    folder.write("row_gain.toml", ROW_GAIN);
    let [file, captures, result] = ["row_gain.toml", "captures", "result"].map(|name| folder.arg(name));
    json(&["simulate", "--frames", "10", "--with", &file, "--out", &captures]);

    let fit = json(&["calibrate", &captures, "--model", &format!("projective+{file}"), "--out", &result]);
    let pieces = fit["calibration"]["camera"]["pieces"].as_array().unwrap();
    let piece = pieces.iter().find(|piece| piece["name"] == "row_gain").unwrap();
    assert_eq!((&piece["of"], &piece["formula"]["formula"]), (&"measured".into(), &"a * y * log(rho / rho0)".into()));
    let (value, std_dev) = (&piece["parameters"][0]["value"], &piece["parameters"][0]["std_dev"]);
    let deviation = (value.as_f64().unwrap() - 3e-5) / std_dev.as_f64().unwrap();
    assert!(deviation.abs() < 4.0, "{value} ± {std_dev}");
    assert_eq!(fit["calibration"]["version"].as_u64().unwrap_or(2), 2);
    let rms = |value: &Value| value["datasets"][0]["depth_rms_mm"]["after"].as_f64().unwrap();

    // Neither apply nor evaluate need the file again.
    std::fs::remove_file(folder.path("row_gain.toml")).unwrap();
    let calibration = folder.path("result").join("calibration.json").display().to_string();
    let with = json(&["evaluate", &calibration, &captures, "--out", &folder.arg("check")]);
    let depth = folder.path("captures").join("depth").display().to_string();
    succeeds(["apply", &calibration, &depth, "--out", &folder.arg("corrected")]);

    // Without the formula the error is much larger; with its true value in addition to a plain D it is small again.
    folder.write("row_gain.toml", ROW_GAIN);
    json(&["calibrate", &captures, "--out", &folder.arg("plain")]);
    let plain = folder.path("plain").join("calibration.json").display().to_string();
    let without = json(&["evaluate", &plain, &captures, "--out", &folder.arg("check")]);
    assert!(rms(&without) > 1.5 * rms(&with), "{} {}", rms(&without), rms(&with));
    let given = json(&["evaluate", &plain, &captures, "--with", &file, "--out", &folder.arg("check")]);
    assert!(rms(&given) != rms(&without));
    fails(
        ["evaluate", &calibration, &captures, "--with", &file, "--out", &folder.arg("check")],
        &["the calibration has 'row_gain' already"],
    );

    let compared = json(&[
        "compare",
        &captures,
        "--models",
        &format!("projective,projective+{file}"),
        "--out",
        &folder.arg("compared"),
    ]);
    assert_eq!(compared["comparison"]["models"][0]["model"], "projective+row_gain@of=measured");
}

#[test]
fn the_command_shows_formulas_in_every_form() {
    let folder = Folder::new();
    folder.write("row_gain.toml", ROW_GAIN);
    let file = folder.arg("row_gain.toml");
    let words = stdout(&succeeds(["formula", &file]));
    assert!(
        words.contains("ρ + a y ln(ρ/ρ₀), of the measured state") && words.contains("rho0 = 0.00125 1/mm"),
        "{words}"
    );
    let rust = stdout(&succeeds(["formula", &file, "--rust"]));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/emitted/row_gain.rs");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &rust).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), rust, "run with UPDATE_DOCS=1");
    assert_eq!(
        stdout(&succeeds(["formula", &file, "--latex"])),
        "\\rho + a \\, y \\, \\ln\\left(\\frac{\\rho}{\\rho_{0}}\\right)\n"
    );
    succeeds(["formula", &file, "--plot", "--rust", "--out", &folder.arg("paper")]);
    assert_eq!(folder.names("paper"), ["row_gain.rs", "row_gain.svg"]);
}

/// The Rust file of the test above.
#[rustfmt::skip]
#[path = "emitted/row_gain.rs"]
mod row_gain;

#[test]
fn the_rust_file_of_a_formula_adds_it_to_a_program() {
    let mut register = Register::builtin();
    row_gain::add(&mut register).unwrap();
    let piece = register.find("row_gain").expect("a piece");
    assert_eq!((&*piece.parameters()[0].name, piece.equation()), ("a", "ρ + a y ln(ρ/ρ₀)"));
    let definition = FormulaFile::parse(ROW_GAIN).unwrap().effects()[0].definition().clone();
    assert_eq!(piece.formula(), Some(&definition));
}

#[test]
fn what_is_wrong_with_a_file_of_formulas_is_said_with_its_place() {
    let folder = Folder::new();
    let file = folder.arg("wrong.toml");
    let refused = |content: &str, parts: &[&str]| {
        folder.write("wrong.toml", content);
        fails(["formula", &file], parts);
    };
    refused(
        &ROW_GAIN.replace("log(rho / rho0)", "log(rho) * rho / rho0"),
        &["line 7, column 24", "'rho' is in 1/mm", "^^^"],
    );
    refused(&ROW_GAIN.replace("log(rho / rho0)", "lg(rho / rho0)"), &["line 7, column 20", "no function 'lg'"]);
    refused(&ROW_GAIN.replace("formula =", "formla ="), &["unknown field `formla`", "line 7"]);
    refused("", &["has no effect"]);
    folder.write("wrong.toml", ROW_GAIN);
    // The names of effects are checked before images are read, but not before the cameras are counted.
    let board = "kind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 25";
    folder.write("captures/dataset.toml", format!("[board]\n{board}\n[frames]\nimage = \"*.png\"\n"));
    folder.write("captures/1.png", "");
    let captures = folder.arg("captures");
    fails(["calibrate", &captures, "--with", &format!("{file}@rho1=3"), "--out", "r"], &["rho1", "rho0"]);
    fails(["calibrate", &captures, "--with", "missing.toml", "--out", "r"], &["missing.toml"]);
    fails(["simulate", "--with", &file, "--effect", "cyclic", "--out", "x"], &["cyclic"]);
}
