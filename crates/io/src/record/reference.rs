//! References to files.

use serde::{Deserialize, Serialize};

/// A file or folder from which a result was computed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FileReference {
    /// Path as the user gave it, or relative to the file that refers to it.
    pub path: String,
    /// Digest of the contents; see [`digest_files`](crate::file::digest_files).
    pub digest: String,
}
