//! A check of the workspace's structure, run by `tests/workspace.rs`.
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
//! `cargo run -p depthcal-structure --example structure` prints all violations in a few seconds, without building the rest of
//! the workspace.

mod check;
mod circles;
mod error;
mod graph;
mod layers;
mod modules;
mod names;
mod prints;
mod references;
mod sources;
mod test_programs;
#[cfg(test)]
mod tests;

pub use check::{CrateReport, check_crate, check_workspace};
pub use circles::circles;
pub use error::StructureError;
pub use graph::{Edge, Graph};
pub use layers::{LAYERS, check_layers};
pub use sources::Sources;
pub use test_programs::check_test_programs;
