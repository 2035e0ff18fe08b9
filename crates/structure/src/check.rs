//! All checks, of one crate and of the workspace.

use std::path::Path;

use crate::circles::{circles, describe};
use crate::error::StructureError;
use crate::graph::Graph;
use crate::layers::{LAYERS, check_layers};
use crate::modules::Tree;
use crate::prints::prints;
use crate::references::file_graph;
use crate::sources::Sources;
use crate::test_programs::check_test_programs;

/// What is wrong with one crate.
#[derive(Clone, Debug, Default)]
pub struct CrateReport {
    /// Number of files that are not tests.
    pub files: usize,
    /// Circles among files, with the line that makes each arrow.
    pub file_circles: Vec<String>,
    /// Circles among top-level modules.
    pub folder_circles: Vec<String>,
    /// Places that print.
    pub prints: Vec<String>,
}

/// Checks the sources of one crate: its library if it has one, and its program.
///
/// # Errors
/// Sources that cannot be parsed, and modules without a file.
pub fn check_crate(sources: &Sources) -> Result<CrateReport, StructureError> {
    let mut report = CrateReport::default();
    for root in ["src/lib.rs", "src/main.rs"].map(Path::new) {
        if sources.text(root).is_none() {
            continue;
        }
        let tree = Tree::build(sources, root)?;
        let graph = file_graph(&tree);
        let describe_all = |graph: &Graph| circles(graph).iter().map(|c| describe(graph, c)).collect::<Vec<_>>();
        report.files += tree.files.len();
        report.file_circles.extend(describe_all(&graph));
        report.folder_circles.extend(describe_all(&graph.grouped(|file| folder(&tree, file))));
        report.prints.extend(prints(&tree));
    }
    Ok(report)
}

/// The top-level module of a file; the crate's root is one of its own.
fn folder(tree: &Tree, file: &str) -> String {
    let module = tree.files.iter().find(|(path, _)| path == Path::new(file)).and_then(|(_, module)| module.first());
    module.map_or_else(|| file.to_owned(), |name| format!("{name}/"))
}

/// Everything that is wrong with the workspace in `root`, one text per violation; empty if nothing is. Sources that cannot be
/// parsed are a violation.
///
/// # Errors
/// As [`check_layers`] and [`check_test_programs`].
pub fn check_workspace(root: &Path) -> Result<Vec<String>, StructureError> {
    let mut violations = check_layers(root)?;
    for layer in &LAYERS {
        let folder = root.join(layer.folder);
        if !folder.join("src").is_dir() {
            continue;
        }
        let report = match Sources::read(&folder).and_then(|sources| check_crate(&sources)) {
            Ok(report) => report,
            // The other crates are worth checking all the same.
            Err(error) => {
                violations.push(format!("{}: {error}", layer.package));
                continue;
            }
        };
        let tagged = |kind: &str, found: Vec<String>| {
            found.into_iter().map(|v| format!("{}, {kind}: {v}", layer.package)).collect::<Vec<_>>()
        };
        violations.extend(tagged("folders", report.folder_circles));
        violations.extend(tagged("files", report.file_circles));
        if layer.package != "depthcal-cli" {
            violations.extend(tagged("prints outside the command line's crate", report.prints));
        }
        violations.extend(tagged("tests", check_test_programs(&folder)?));
    }
    Ok(violations)
}
