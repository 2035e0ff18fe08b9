//! Every threshold of a diagnosis is in docs/thresholds.md with its value.

use std::collections::BTreeSet;
use std::path::Path;

/// The lines `name: value,` of a struct's default.
fn defaults(source: &str) -> BTreeSet<(String, String)> {
    let body = source.split("impl Default for Thresholds").nth(1).unwrap();
    let fields = body.lines().filter_map(|line| line.trim().strip_suffix(',')?.split_once(": "));
    fields.map(|(name, value)| (name.to_owned(), value.to_owned())).collect()
}

/// Name and value of the rows of the first table.
fn documented(page: &str) -> BTreeSet<(String, String)> {
    let rows =
        page.lines().skip_while(|line| !line.starts_with("| threshold |")).take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        Some((cells[1].strip_prefix('`')?.strip_suffix('`')?.to_owned(), cells[2].to_owned()))
    };
    rows.filter_map(row).collect()
}

#[test]
fn every_threshold_is_documented_with_its_value() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap();
    let defaults = defaults(&read("crates/calibration/src/diagnose/thresholds.rs"));
    assert!(defaults.len() > 40, "{} thresholds were read", defaults.len());
    assert_eq!(documented(&read("docs/thresholds.md")), defaults);
}
