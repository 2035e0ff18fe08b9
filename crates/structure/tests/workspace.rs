//! Dependencies without circles, and sources of readable size, width and names; see `crates/structure` for what counts.

use std::path::Path;

#[test]
fn the_structure_has_no_violations() {
    let report = depthcal_structure::check_workspace(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")).unwrap();
    if !report.postponed.is_empty() {
        println!("postponed: {}\n{}", report.postponed.len(), report.postponed.join("\n"));
    }
    assert!(report.violations.is_empty(), "{} violations\n{}", report.violations.len(), report.violations.join("\n"));
}
