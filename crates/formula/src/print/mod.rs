//! Formulas in print: as text, LaTeX and MathML, and as the Rust file of a piece.

mod equation;
mod latex;
mod mathml;
mod notation;
mod piece_file;
mod rust;
mod symbol;
mod text;

pub(crate) use equation::{equation, latex, mathml};
pub(crate) use piece_file::piece_file;
