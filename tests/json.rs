//! Results for machines: `--json` of the commands that fit and judge, on rendered captures.

#![cfg(feature = "detect")]

use crate::support::{Folder, schemas, stderr, stdout, succeeds};
use serde_json::Value;

fn json(arguments: &[&str]) -> (Value, String) {
    let output = succeeds(arguments.iter().chain(&["--json"]));
    (serde_json::from_str(&stdout(&output)).unwrap(), stderr(&output))
}

/// The stages of a run; the time of each is a positive number.
fn stages(value: &Value) -> Vec<String> {
    let stages = value["stages"].as_array().unwrap_or_else(|| panic!("no stages: {value}"));
    assert!(stages.iter().all(|s| s["seconds"].as_f64().unwrap() > 0.0), "{stages:?}");
    stages.iter().map(|s| s["stage"].as_str().unwrap().to_owned()).collect()
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
    calibrates(&captures, &result);
    let calibration = format!("{result}/calibration.json");
    evaluates(&folder, &calibration, &other);

    let before = std::fs::read(&calibration).unwrap();
    let (_, words) = json(&["evaluate", &calibration, &other, "--out", &result]);
    for name in ["evaluation.json", "report.html"] {
        assert!(words.contains(&format!("replaced: {result}/{name}, ")), "{words}");
    }
    assert_eq!(std::fs::read(&calibration).unwrap(), before, "beside its evaluation a calibration stays");

    diagnoses(&folder, &captures, &other);
    compares(&captures, &other, &folder.arg("compared"));

    // What was written follows the schemas.
    for (file, name) in [
        ("result/observations.json", "observations"),
        ("result/calibration.json", "calibration"),
        ("result/evaluation.json", "evaluation"),
        ("check/evaluation.json", "evaluation"),
        ("diagnosed/diagnosis.json", "diagnosis"),
        ("diagnosed/calibration.json", "calibration"),
        ("compared/comparison.json", "comparison"),
    ] {
        schemas::follows(folder.path(file), name);
    }
    let (value, _) = json(&["schema", "calibration"]);
    assert_eq!(value["schema"]["properties"]["format"]["const"], "depthcal-calibration");
}

fn calibrates(captures: &str, result: &str) {
    let (value, words) = json(&["calibrate", captures, "--out", result]);
    let used = value["frames"]["used"].as_u64().unwrap();
    let dropped = value["frames"]["dropped"].as_array().unwrap();
    assert_eq!(used as usize + dropped.len(), 12, "{value}");
    assert!(dropped.iter().all(|d| d["reason"].is_string()));
    assert!(words.contains("the board was found in"), "{words}");
    assert!(value["calibration"]["camera"]["pieces"].as_array().unwrap().len() >= 3);
    assert!(value["datasets"][0]["depth_rms_mm"]["after"].as_f64().unwrap() > 0.0);
    let named = stages(&value);
    for stage in ["reading images", "image calibration", "joint adjustment", "evaluation", "report"] {
        assert_eq!(named.iter().filter(|s| *s == stage).count(), 1, "{stage} in {named:?}");
    }
    assert!(!words.contains("joint adjustment"), "silent without -v: {words}");
    for path in value["written"].as_array().unwrap() {
        assert!(std::path::Path::new(path.as_str().unwrap()).is_file(), "{path}");
    }
}

fn evaluates(folder: &Folder, calibration: &str, other: &str) {
    let (value, words) = json(&["evaluate", calibration, other, "-v", "--out", &folder.arg("check")]);
    let stages_of_evaluation = stages(&value);
    assert!(stages_of_evaluation.iter().any(|s| s == "evaluation"), "{stages_of_evaluation:?}");
    let table = words.split_once("stage  ").expect("a table with -v").1;
    assert!(stages_of_evaluation.iter().all(|s| table.contains(s.as_str())), "{words}");
    assert!(words.contains("INFO evaluation: ") && table.contains("everything else"), "{words}");
    let html = std::fs::read_to_string(folder.path("check/report.html")).unwrap();
    assert!(html.contains("until this report") && html.contains("<th scope=\"row\">evaluation</th>"));
    let evaluation = std::fs::read_to_string(folder.path("check/evaluation.json")).unwrap();
    assert!(!evaluation.contains("stages") && !evaluation.contains("seconds"), "files have no times");
    assert_eq!(value["frames"][0]["dataset"], "other");
    assert_eq!(value["datasets"][0]["name"], "other");
}

fn diagnoses(folder: &Folder, captures: &str, other: &str) {
    let (value, _) = json(&["diagnose", captures, "--verify", other, "--out", &folder.arg("diagnosed")]);
    let rounds = stages(&value);
    for part in ["round 1: examining", "round 1: fitting", "judging on held-out frames", "separability"] {
        assert!(rounds.iter().any(|s| s.contains(part)), "{part} in {rounds:?}");
    }
    let diagnosis = &value["diagnosis"];
    assert_eq!(diagnosis["steps"][0]["effects"][0], "cyclic_depth", "{diagnosis}");
    assert_eq!(diagnosis["separability"]["effects"][0], "cyclic_depth");
    let html = std::fs::read_to_string(folder.path("diagnosed/report.html")).unwrap();
    assert!(html.contains("What to capture next?") && html.contains("id=\"separability\""));
}

fn compares(captures: &str, other: &str, out: &str) {
    let (value, _) =
        json(&["compare", captures, "--verify", other, "--models", "none,projective", "--learning", "0", "--out", out]);
    assert_eq!(value["comparison"]["models"].as_array().unwrap().len(), 2);
    assert_eq!(value["frames"].as_array().unwrap().len(), 2);
}
