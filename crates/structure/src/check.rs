//! All checks, of one crate and of the workspace.

use std::path::Path;

use crate::bindings::check_bindings;
use crate::circles::{circles, describe};
use crate::comments::{check_beginnings, check_comment_width};
use crate::error::StructureError;
use crate::graph::Graph;
use crate::layers::{LAYERS, check_layers};
use crate::modules::Tree;
use crate::references::file_graph;
use crate::size::check_size;
use crate::source_files::{SourceFile, source_files};
use crate::sources::Sources;
use crate::test_programs::check_test_programs;

/// Folders that are restructured at the moment: what is wrong with the size, the comments and the names of their files fails
/// nothing and is listed apart. Empty where no folder is restructured.
const POSTPONED: [&str; 0] = [];

/// Violations in the workspace, one text each.
#[derive(Clone, Debug, Default)]
pub struct WorkspaceReport {
    /// To be mended now.
    pub violations: Vec<String>,
    /// In folders whose files may violate the rules on size, comments and names until they are restructured.
    pub postponed: Vec<String>,
}

/// Violations in one crate.
#[derive(Clone, Debug, Default)]
pub struct CrateReport {
    /// Number of files that are not tests.
    pub files: usize,
    /// Circles among files, with the line that makes each arrow.
    pub file_circles: Vec<String>,
    /// Circles among top-level modules.
    pub folder_circles: Vec<String>,
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
    }
    Ok(report)
}

/// The top-level module of a file; the crate's root is one of its own.
fn folder(tree: &Tree, file: &str) -> String {
    let module = tree.files.iter().find(|(path, _)| path == Path::new(file)).and_then(|(_, module)| module.first());
    module.map_or_else(|| file.to_owned(), |name| format!("{name}/"))
}

/// All violations in the workspace in `root`. Sources of a library that cannot be parsed are a violation.
///
/// # Errors
/// As [`check_layers`], [`check_test_programs`] and [`source_files`].
pub fn check_workspace(root: &Path) -> Result<WorkspaceReport, StructureError> {
    let mut report = WorkspaceReport { violations: check_dependencies(root)?, postponed: Vec::new() };
    for file in source_files(root)? {
        let postponed = POSTPONED.iter().any(|folder| file.path.starts_with(folder));
        let target = if postponed { &mut report.postponed } else { &mut report.violations };
        target.extend(check_file(&file));
    }
    Ok(report)
}

/// Violations of the rules on size, comments and names in one file.
fn check_file(file: &SourceFile) -> Vec<String> {
    [check_size(file), check_comment_width(file), check_beginnings(file), check_bindings(file)].concat()
}

/// Violations of the rules on dependencies, printing and forgotten tests.
fn check_dependencies(root: &Path) -> Result<Vec<String>, StructureError> {
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
        let tagged = |kind: &str, violations: Vec<String>| {
            violations.into_iter().map(|v| format!("{}, {kind}: {v}", layer.package)).collect::<Vec<_>>()
        };
        violations.extend(tagged("folders", report.folder_circles));
        violations.extend(tagged("files", report.file_circles));
        violations.extend(tagged("tests", check_test_programs(&folder)?));
    }
    Ok(violations)
}
