//! Every number on the first screen of a report is in one of the result files in the same folder.

#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::{Folder, succeeds};

/// Parts of result files that no first screen speaks of, and that are long enough to have any number by chance.
const LONG: [&str; 8] =
    ["covariance", "observations", "frames", "frame_planes", "separability", "pieces", "lens_comparison", "free"];

/// Factors between a number in a file and the same one for people, by the unit that follows it: shares or per cent, and metres.
fn factors(unit: &str) -> &'static [f64] {
    match unit {
        "%" => &[1.0, 100.0],
        "m" => &[1e-3],
        _ => &[1.0],
    }
}

/// The numbers of a result file: its values, the numbers in its sentences, and how many entries its lists have.
fn numbers_of(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Object(fields) => {
            if let Some(fall) = fall_percent(fields) {
                numbers.push(fall);
            }
            for (name, field) in fields {
                match field {
                    Value::Array(list) if LONG.contains(&name.as_str()) => numbers.push(list.len() as f64),
                    _ if LONG.contains(&name.as_str()) => {}
                    _ => numbers_of(field, numbers),
                }
            }
        }
        Value::Array(list) => {
            numbers.push(list.len() as f64);
            list.iter().for_each(|entry| numbers_of(entry, numbers));
        }
        Value::Number(number) => numbers.extend(number.as_f64()),
        Value::String(text) => numbers.extend(shown(text).into_iter().map(|shown| shown.number)),
        Value::Null | Value::Bool(_) => {}
    }
}

/// Fall of an error, or of its mean, between the values before and after correction, per cent.
fn fall_percent(fields: &serde_json::Map<String, Value>) -> Option<f64> {
    let value = |name: &str| {
        let field = fields.get(name)?;
        field.as_f64().or_else(|| field.get("mean")?.as_f64())
    };
    Some(100.0 * (1.0 - value("after")? / value("before")?))
}

/// A number in a text.
struct Shown {
    /// Byte at which it begins.
    place: usize,
    number: f64,
    /// Half of a unit of its last digit.
    half_digit: f64,
}

/// The numbers in a text. Digits within names are none.
fn shown(text: &str) -> Vec<Shown> {
    let mut numbers = Vec::new();
    let mut start = None;
    let ends = text.char_indices().chain([(text.len(), ' ')]);
    for (place, c) in ends {
        let is_within = c.is_alphanumeric() || c == '_' || c == '.' || (c == '−' && text[..place].ends_with('e'));
        match (start, is_within) {
            (None, true) => start = Some(place),
            (Some(first), false) => {
                start = None;
                let word = text[first..place].trim_end_matches('.').replace('−', "-");
                if let Ok(number) = word.parse::<f64>() {
                    let (digits, exponent) = word.split_once('e').unwrap_or((&word, "0"));
                    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
                    let exponent: i32 = exponent.parse().unwrap_or(0);
                    let half_digit = 0.5 * 10_f64.powi(exponent - decimals);
                    numbers.push(Shown { place: first, number, half_digit });
                }
            }
            _ => {}
        }
    }
    numbers
}

/// The text of the first screen of a report.
fn first_screen(html: &str) -> String {
    let (_, screen) = html.split_once("<p class=\"verdict\"").expect("a verdict");
    let (screen, _) = screen.split_once("<section").unwrap_or((screen, ""));
    let mut text = String::new();
    let mut is_tag = true;
    for c in screen.chars() {
        match c {
            '<' => is_tag = true,
            '>' => {
                is_tag = false;
                text.push(' ');
            }
            _ if !is_tag => text.push(c),
            _ => {}
        }
    }
    text
}

/// Words for the level of an interval, and for the share of pixels within a range.
const LEVELS: [&str; 2] = ["95 % interval", "90 % of the pixels"];

/// Counts the numbers on the first screen of the report in a folder, and lists those that are in none of the folder's result
/// files, each with the text around it.
fn unfounded(folder: &Path) -> (usize, Vec<String>) {
    let mut known = Vec::new();
    for file in ["calibration.json", "evaluation.json", "diagnosis.json"] {
        if let Ok(text) = fs::read_to_string(folder.join(file)) {
            numbers_of(&serde_json::from_str(&text).unwrap(), &mut known);
        }
    }
    let html = fs::read_to_string(folder.join("report.html")).unwrap();
    let text = first_screen(&html).replace('\u{a0}', " ").replace("&#39;", "'");
    let all = shown(&text);
    let is_known = |shown: &Shown| {
        let following = text[shown.place..].trim_start_matches(|c: char| c.is_numeric() || ".e−".contains(c));
        let unit: String = following.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '%').collect();
        let is_near = |value: f64| (value.abs() - shown.number).abs() <= shown.half_digit * (1.0 + 1e-6);
        known.iter().any(|k| factors(&unit).iter().any(|factor| is_near(k * factor)))
    };
    let around = |place: usize| {
        let before = text[..place].char_indices().rev().nth(40).map_or(0, |(start, _)| start);
        text[before..].chars().take(80).collect::<String>()
    };
    let is_unfounded = |shown: &&Shown| {
        let is_level = LEVELS.iter().any(|level| text[shown.place..].starts_with(level));
        !is_known(shown) && !is_level
    };
    let unknown = all.iter().filter(is_unfounded).map(|shown| around(shown.place)).collect();
    (all.len(), unknown)
}

#[test]
fn numbers_of_the_first_screen_are_those_of_the_files() {
    let scratch = Folder::new();
    let (capture, calibrated, diagnosed) =
        (scratch.arg("capture"), scratch.arg("calibrated"), scratch.arg("diagnosed"));
    succeeds(["simulate", "--effect", "cyclic_depth=6", "--frames", "14", "--seed", "4", "--out", &capture]);
    succeeds(["calibrate", &capture, "--cross-validate", "5", "--out", &calibrated]);
    succeeds(["diagnose", &capture, "--out", &diagnosed]);
    for folder in ["calibrated", "diagnosed"] {
        let (count, unknown) = unfounded(&scratch.path(folder));
        assert!(count > 10, "{folder}: {count} numbers");
        assert!(unknown.is_empty(), "{folder}, of {count} numbers: {unknown:#?}");
    }
}

/// A number that no file has is seen.
#[test]
fn a_number_of_no_file_is_unfounded() {
    let folder = Folder::new();
    folder.write(
        "evaluation.json",
        r#"{"depth_rms_mm": {"before": 8.6049, "after": 1.2}, "share": 0.0213, "distance_mm": 1970}"#,
    );
    let page = |numbers: &str| format!("<p class=\"verdict\"><b>{numbers}</b></p><section>77</section>");
    folder.write("report.html", page("8.60 mm rms, 2.13 % of found_x2, 1.20 mm, 1.97 m away"));
    let root = folder.path("");
    assert_eq!(unfounded(&root), (4, Vec::new()));
    folder.write("report.html", page("8.61 mm rms, 2.13 mm"));
    assert_eq!(unfounded(&root).1.len(), 2);
}
