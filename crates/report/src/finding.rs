//! A systematic error that is left after correction: over which quantity, how large, and where.

use super::binned::Structure;

/// The data over which an error is systematic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Over {
    /// Frames, each of which is off as a whole.
    WholeFrames,
    /// A quantity that the errors were binned over: `the position in the image`, `the distance`.
    Quantity(String),
}

impl std::fmt::Display for Over {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::WholeFrames => f.write_str("whole frames"),
            Self::Quantity(words) => f.write_str(words),
        }
    }
}

/// The outcome of one test for a systematic error.
#[derive(Debug, Clone)]
pub(super) struct Finding {
    /// The data over which it was tested.
    pub over: Over,
    /// Size and significance.
    pub structure: Structure,
    /// Where it is largest and the error there, in words.
    pub worst: String,
    /// Whether noise fails to explain it, with the number of tests allowed for.
    pub found: bool,
}
