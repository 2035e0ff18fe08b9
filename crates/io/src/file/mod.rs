//! Errors, atomic writing, JSON and digests, which all files share.

mod digest;
mod error;
mod finite;
mod json;
mod staged;
mod staged_dataset;
mod stand_in;
mod temporary;
mod versioned;
mod write;

pub use digest::{digest_contents, digest_files, digest_json};
pub use error::FileError;
pub use json::{is_of_depthcal, read_json, write_json, write_json_compact};
pub use staged::{Displaced, OF_CALIBRATION, StagedResults, check_writable};
pub use staged_dataset::StagedDataset;
pub(crate) use stand_in::StandIn;
pub use temporary::is_temporary;
#[cfg(test)]
pub(crate) use versioned::parse_versioned;
pub(crate) use versioned::{Fault, Versioned, read_versioned, write_versioned};
pub use write::write_atomically;
