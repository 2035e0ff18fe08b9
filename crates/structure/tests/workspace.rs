//! Files, folders and crates of the workspace depend on each other without circles; the library says what counts.

use std::path::Path;

#[test]
fn the_structure_has_no_circles() {
    let violations = depthcal_structure::check_workspace(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")).unwrap();
    assert!(violations.is_empty(), "{} violations\n{}", violations.len(), violations.join("\n"));
}
