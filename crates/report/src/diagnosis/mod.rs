//! A diagnosis in words: questions and answers for the first screen of its report, the sections behind them, and a page of
//! text for a terminal.
//!
//! All of it is worded from the record (`diagnosis.json`) and from errors of frames; nothing here looks into the search that
//! made the record.

mod answers;
mod formula;
mod remedies;
mod sections;
pub(crate) mod sentences;
mod text;

pub(super) use answers::{Answer, answers, pill, sentence};
pub(super) use sections::{apart, candidates, frames, next, steps};
pub use text::{Detail, diagnosis_text, verdict_sentence};
