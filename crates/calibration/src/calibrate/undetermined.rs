//! Parameters that the captures leave undetermined, in the users' words, with reasons and remedies.

use std::fmt;

/// Names that a message lists, such as those of parameters of the captures' most important combinations.
const MOST_NAMED: usize = 6;
/// Parameters that the captures leave undetermined, the reasons, and the remedies.
#[derive(Debug, Clone, PartialEq)]
pub struct UndeterminedModel {
    /// Number of combinations of parameters that are undetermined.
    pub combinations: usize,
    /// The parameters that take part, `PIECE.PARAMETER`, the most important first.
    pub parameters: Vec<String>,
    /// Frames whose poses take part, where no parameter of the camera does.
    pub frames: Vec<String>,
    /// Why they are undetermined, in words.
    pub reasons: Vec<String>,
    /// Captures that would determine them, in words.
    pub captures: Vec<String>,
}

impl fmt::Display for UndeterminedModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = if self.parameters.is_empty() {
            format!("the poses of {}", listed(&self.frames))
        } else {
            listed(&self.parameters)
        };
        let count = match self.combinations {
            1 => "a combination".to_owned(),
            n => format!("{n} combinations"),
        };
        writeln!(f, "the captures leave {count} undetermined of {what}")?;
        writeln!(f, "why: {}", self.reasons.join("; "))?;
        write!(f, "capture: {}", self.captures.join("; "))?;
        if let Some(last) = self.parameters.last() {
            write!(f, "\nor hold what you do not need: --with fixed:{last}")?;
        }
        Ok(())
    }
}

/// The first of some names, and how many more there are.
pub(super) fn listed(names: &[String]) -> String {
    let more = names.len().saturating_sub(MOST_NAMED);
    let shown = names.iter().take(MOST_NAMED).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}
