//! The diameter of a board's dots: measured in the images where it is not declared, and compared with them where it is.

use crate::support::{Folder, stderr, stdout, succeeds};
use depthcal_simulate::Board;

/// The lines of `calibrate` about the dots of a capture whose `dataset.toml` has `circle_diameter_mm` so, or not at all.
fn said(folder: &Folder, declared_mm: Option<f64>) -> String {
    let file = folder.path("capture/dataset.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let others = text.lines().filter(|l| !l.trim_start().starts_with("circle_diameter_mm"));
    let declared = declared_mm.map(|d| format!("circle_diameter_mm = {d}"));
    let mut lines = Vec::new();
    for line in others {
        lines.push(line.to_owned());
        if line.trim() == "[board]" {
            lines.extend(declared.clone());
        }
    }
    std::fs::write(&file, lines.join("\n") + "\n").unwrap();
    let output = succeeds(["calibrate", &folder.arg("capture"), "--out", &folder.arg("result"), "--no-cache", "-v"]);
    stdout(&output) + &stderr(&output)
}

#[test]
fn a_missing_diameter_is_measured_and_a_wrong_one_is_said() {
    let folder = Folder::new();
    succeeds(["simulate", "--out", &folder.arg("capture"), "--seed", "5", "--frames", "8"]);
    let truth_mm = Board::default().circle_diameter_mm().unwrap();
    let measured = |text: &str| -> f64 {
        let (_, after) = text.split_once("the dots measure ").unwrap_or_else(|| panic!("{text}"));
        after.split_whitespace().next().unwrap().parse().unwrap()
    };
    let missing = said(&folder, None);
    assert!((measured(&missing) / truth_mm - 1.0).abs() < 0.02, "{missing}");
    assert!(missing.contains("is not declared"), "{missing}");
    let right = said(&folder, Some(truth_mm));
    assert!(!right.contains("but dataset.toml declares"), "{right}");
    let wrong = said(&folder, Some(1.2 * truth_mm));
    assert!((measured(&wrong) / truth_mm - 1.0).abs() < 0.02, "{wrong}");
    assert!(wrong.contains("but dataset.toml declares circle_diameter_mm"), "{wrong}");
}
