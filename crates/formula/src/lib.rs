//! Effects of depth cameras given as formulas.
//!
//! A formula is a line of mathematics over covariates of an observation, parameters that are fitted, and constants:
//!
//! ```
//! use depthcal_formula::FormulaFile;
//!
//! let file = FormulaFile::parse(
//!     r#"
//!     [[effect]]
//!     name = "row_gain"
//!     hook = "depth"
//!     adds_to = "inverse_depth"
//!     formula = "a * y * log(rho / rho0)"
//!     parameters = { a = "1/mm" }
//!     constants = { rho0 = 0.00125 }
//!     "#,
//! )?;
//! let effect = &file.effects()[0];
//! assert_eq!(effect.units_of_constants()["rho0"], "1/mm");
//! # Ok::<(), depthcal_formula::FormulaFileError>(())
//! ```
//!
//! The text is parsed into an expression ([`pest`] keeps the place of every part, so that messages can show it), checked for
//! units, and put into a graph in which equal parts are one node. Derivatives are nodes of the same graph, so they are exact.
//! What a fit needs is a sequence of instructions that runs over batches of observations: a [`FormulaEffect`] gives a piece like
//! those written in Rust. It prints as a formula for people, and as a Rust file that adds it to a program.
//!
//! Invariants: nothing is evaluated before it has been checked; a formula is zero at its nominal parameters; no text can make
//! this crate panic, allocate without bound or recurse deeply.

mod content;
mod covariate;
mod effect;
mod error;
mod file;
mod function;
mod graph;
mod intern;
mod lowering;
mod named_files;
mod piece;
mod print;
mod reader;
mod rust_file;
mod shape;
mod syntax;
mod units;

pub use covariate::FormulaCovariate;
pub use effect::FormulaEffect;
pub use error::{FormulaError, FormulaFileError};
pub use file::{FormulaFile, file_text};
pub use function::FormulaFunction;

pub use named_files::{NamedFileError, resolve, resolve_lens, resolve_model, values};
pub use reader::MOST_PARAMETERS;
