//! Why sources or manifests cannot be checked.

use std::path::PathBuf;

/// A source or manifest that cannot be read, parsed or found.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "fields are named by the messages")]
pub enum StructureError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}:{line}: not valid Rust: {message}", path.display())]
    Syntax { path: PathBuf, line: usize, message: String },
    #[error("{}: not a valid manifest: {message}", path.display())]
    Manifest { path: PathBuf, message: String },
    #[error("{}: no file for `mod {name};`: expected {name}.rs or {name}/mod.rs", path.display())]
    MissingModule { path: PathBuf, name: String },
}
