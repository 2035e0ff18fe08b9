//! Problems of benchmarks of solvers.

use std::path::Path;

use crate::bal::BalProblem;
use crate::g2o::G2oGraph;

use super::memory_folder;

/// A problem of Bundle Adjustment in the Large, plain or compressed.
pub fn bal(bytes: &[u8]) {
    if let Ok(problem) = BalProblem::parse(Path::new("problem"), bytes) {
        assert!(
            problem.observations.iter().all(|o| o.camera < problem.cameras.len() && o.point < problem.points.len())
        );
    } else if bytes.starts_with(b"BZh") {
        let _ = BalProblem::read(memory_folder::file("problem.bz2", bytes));
    }
}

/// A pose graph.
pub fn g2o(bytes: &[u8]) {
    let _ = G2oGraph::parse(Path::new("graph"), bytes);
}
