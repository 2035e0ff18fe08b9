//! Units: their algebra, and the check that a formula's units agree.

mod check;
mod inference;
mod unit;

pub(crate) use check::{Clash, check};
pub(crate) use inference::Inference;
pub(crate) use unit::Unit;
