//! Checks of the workspace's structure and of the form of its sources, run by `tests/workspace.rs`.
//!
//! # Dependencies
//!
//! Files of a crate must form a directed acyclic graph, so must its top-level modules ("folders"), and crates may depend only
//! on crates below them in a declared order. Only code that is compiled into the library counts: items under `#[cfg(test)]`,
//! `tests.rs` and `tests/` are left out. Of `tests/` it is checked that no file is forgotten by the test programs.
//!
//! A file depends on another if it names an item that the other defines: in a `use`, in a path of an expression, a type, a
//! pattern or a macro's arguments. A re-export is followed to the file that defines the item, so a `mod.rs` that only declares
//! and re-exports is never the target of an edge. A method that is called on `self`, or as `Type::name`, is looked up in the
//! inherent `impl` blocks of all files; other method calls need type inference and are not seen.
//!
//! # Form
//! All files, those of tests, examples and benches too, are held to limits on the length of functions, signatures and files, and
//! on the width of comments; to documentation that begins with what an item is; and to names that say something.
//!
//! `cargo run -p depthcal-structure --example structure` prints all violations in a few seconds, without building the rest of
//! the workspace.

mod bindings;
mod check;
mod circles;
mod comments;
mod error;
mod graph;
mod layers;
mod modules;
mod names;
mod references;
mod size;
mod source_files;
mod sources;
mod test_programs;
#[cfg(test)]
mod tests;

pub use bindings::check_bindings;
pub use check::{CrateReport, WorkspaceReport, check_crate, check_workspace};
pub use circles::circles;
pub use comments::{COMMENT_WIDTH, check_beginnings, check_comment_width};
pub use error::StructureError;
pub use graph::{Edge, Graph};
pub use layers::{LAYERS, check_layers};
pub use size::{ARGUMENTS, FILE_LINES, FUNCTION_LINES, check_size};
pub use source_files::{SourceFile, source_files};
pub use sources::Sources;
pub use test_programs::check_test_programs;
