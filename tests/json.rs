//! Results for machines: `--json` of the commands that fit and judge, on rendered captures.

#![cfg(feature = "detect")]

mod support;

use serde_json::Value;
use support::{Folder, stderr, stdout, succeeds};

fn json(arguments: &[&str]) -> (Value, String) {
    let output = succeeds(arguments.iter().chain(&["--json"]));
    (serde_json::from_str(&stdout(&output)).unwrap(), stderr(&output))
}

#[test]
fn calibrate_evaluate_diagnose_and_compare() {
    let folder = Folder::new();
    let (captures, other) = (folder.arg("captures"), folder.arg("other"));
    for (kind, out) in [("general1", &captures), ("general2", &other)] {
        let (value, _) =
            json(&["simulate", "--kind", kind, "--frames", "12", "--effect", "cyclic_depth=6", "--out", out]);
        assert_eq!((&value["command"], &value["frames"]), (&"simulate".into(), &12.into()));
    }
    let result = folder.arg("result");
    let (value, words) = json(&["calibrate", &captures, "--out", &result]);
    let used = value["frames"]["used"].as_u64().unwrap();
    let dropped = value["frames"]["dropped"].as_array().unwrap();
    assert_eq!(used as usize + dropped.len(), 12, "{value}");
    assert!(dropped.iter().all(|d| d["reason"].is_string()));
    assert!(words.contains("the board was found in"), "{words}");
    assert!(value["calibration"]["camera"]["pieces"].as_array().unwrap().len() >= 3);
    assert!(value["datasets"][0]["depth_rms_mm"]["after"].as_f64().unwrap() > 0.0);
    for path in value["written"].as_array().unwrap() {
        assert!(std::path::Path::new(path.as_str().unwrap()).is_file(), "{path}");
    }

    let calibration = format!("{result}/calibration.json");
    let (value, _) = json(&["evaluate", &calibration, &other, "--out", &folder.arg("check")]);
    assert_eq!(value["frames"][0]["dataset"], "other");
    assert_eq!(value["datasets"][0]["name"], "other");

    let (value, _) = json(&["diagnose", &captures, "--verify", &other, "--out", &folder.arg("diagnosed")]);
    let diagnosis = &value["diagnosis"];
    assert_eq!(diagnosis["steps"][0]["effects"][0], "cyclic_depth", "{diagnosis}");
    assert_eq!(diagnosis["separability"]["effects"][0], "cyclic_depth");
    let html = std::fs::read_to_string(folder.path("diagnosed/report.html")).unwrap();
    assert!(html.contains("What to capture next?") && html.contains("id=\"separability\""));

    let (value, _) = json(&[
        "compare",
        &captures,
        "--verify",
        &other,
        "--models",
        "none,projective",
        "--no-thesis",
        "--learning",
        "0",
        "--out",
        &folder.arg("compared"),
    ]);
    assert_eq!(value["comparison"]["models"].as_array().unwrap().len(), 2);
    assert_eq!(value["frames"].as_array().unwrap().len(), 2);
}
