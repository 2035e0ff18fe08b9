//! A systematic error that is left after correction: over which quantity, how large, and where.

use super::binned::Structure;

/// The `over` of a finding about whole frames.
pub(super) const WHOLE_FRAMES: &str = "whole frames";

/// The outcome of one test for a systematic error.
#[derive(Debug, Clone)]
pub(super) struct Finding {
    /// The quantity that the errors were binned over: `the position in the image`, `the distance`.
    pub over: String,
    /// Size and significance.
    pub structure: Structure,
    /// Where it is largest and the error there, in words.
    pub worst: String,
    /// Whether noise fails to explain it, with the number of tests allowed for.
    pub found: bool,
}
