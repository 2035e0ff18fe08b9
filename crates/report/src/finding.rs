//! A systematic error that is left after correction: over which quantity, how large, and where.

use super::binned::Structure;
use super::format::{number, signed};
use depthcal_io::WholeFrames;

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

impl Finding {
    /// That frames are off as wholes; whether they are is not decided yet.
    pub(super) fn of_whole_frames(frames: &WholeFrames) -> Self {
        let WholeFrames { p_value, size_mm, detectable_mm, worst, .. } = frames;
        Self {
            over: Over::WholeFrames,
            structure: Structure { p_value: *p_value, size_mm: *size_mm, hidden_mm: *detectable_mm },
            worst: format!(
                "in frame {} at {} mm: {} mm, with a standard deviation of {} mm by noise, pose and fit",
                worst.name,
                number(worst.distance_mm),
                signed(worst.error_mm),
                number(worst.std_dev_mm)
            ),
            found: false,
        }
    }
}
