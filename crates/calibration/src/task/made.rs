//! How results were made.

use crate::stage_clock::StageTimes;

/// How results were made.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Made {
    /// The command line, or the call.
    pub command_line: String,
    /// The time of every stage before the report; nothing is shown where there are none.
    pub stages: StageTimes,
}
