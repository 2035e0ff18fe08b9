//! Errors of checkpoint files.

use std::io;
use std::path::PathBuf;

use crate::problem::key::VariableId;

/// A checkpoint cannot be written or read, or belongs to another problem or to other options.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// Reading or writing failed.
    #[error("checkpoint {}: cannot be {action}: {source}; check that the folder exists and may be written to", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operation that failed: `read` or `written`.
        action: &'static str,
        /// The reason.
        source: io::Error,
    },
    /// The file is damaged or is not a checkpoint.
    #[error("checkpoint {}: not a complete checkpoint: {reason}; delete the file to start anew", path.display())]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// The file has another version of the format.
    #[error(
        "checkpoint {}: has format version {found}, this program reads version {expected}; finish the run with the program \
         that wrote the file, or delete it to start anew", path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version that this program reads.
        expected: u32,
    },
    /// The file belongs to another problem.
    #[error(
        "checkpoint {}: belongs to another problem: {reason}; give another file name, or delete the file to start anew",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The difference.
        reason: String,
    },
    /// The run was started with other options.
    #[error(
        "checkpoint {}: the run was started with {option} = {stored}, not {given}; use the same value, or delete the file to \
         start anew", path.display()
    )]
    Options {
        /// The file.
        path: PathBuf,
        /// Name of the option.
        option: String,
        /// Its value in the file.
        stored: String,
        /// Its value now.
        given: String,
    },
    /// The type of a variable does not implement [`Variable::state`](crate::Variable::state).
    #[error(
        "checkpoint {}: variable {} is of type {type_name}, which cannot be stored; implement Variable::state and \
         Variable::with_state for it", path.display(), variable.index()
    )]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The variable.
        variable: VariableId,
        /// Its type.
        type_name: &'static str,
    },
}
