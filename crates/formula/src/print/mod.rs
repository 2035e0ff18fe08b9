//! Formulas in print: as text, LaTeX and MathML.

mod equation;
mod latex;
mod mathml;
mod notation;
mod symbol;
mod text;

pub(crate) use equation::{equation, latex, mathml};
