//! Errors of formulas.

use std::path::PathBuf;

use depthcal_model::hook::HookKind;
use thiserror::Error;

/// Why a formula is no effect.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FormulaError {
    /// A place in a formula, or in a unit, is at fault.
    #[error("effect '{effect}', {field}, line {line}, column {column}: {problem}\n{excerpt}")]
    Text {
        /// Name of the effect.
        effect: String,
        /// The field: `formula`, or that of a unit.
        field: String,
        /// Line from 1, in the file where the place there is known, else in the text.
        line: usize,
        /// Column from 1, in characters.
        column: usize,
        /// The fault and the remedy.
        problem: String,
        /// The line, with the place marked below it.
        excerpt: String,
    },
    /// A field other than a formula is at fault.
    #[error("effect '{effect}', {field}: {problem}")]
    Field {
        /// Name of the effect.
        effect: String,
        /// The field.
        field: String,
        /// The fault and the remedy.
        problem: String,
    },
    /// An effect cannot act at this hook.
    #[error("effect '{effect}', hook: no formula acts on the {}: write depth, lens, pixel or board", hook.name())]
    Hook {
        /// Name of the effect.
        effect: String,
        /// The hook.
        hook: HookKind,
    },
    /// A piece of depthcal has this name.
    #[error("effect '{effect}', name: a piece of depthcal has this name: choose another")]
    NameTaken {
        /// Name of the effect.
        effect: String,
    },
}

/// Why a file of formulas could not be read.
#[derive(Debug, Error)]
pub enum FormulaFileError {
    /// The file could not be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is larger than any file of formulas.
    #[error("{}: is larger than {limit} bytes, which no file of formulas is", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Most bytes that are read.
        limit: u64,
    },
    /// The file is no TOML, or has fields that effects do not have.
    #[error("{}: {message}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// The message, with line, column and excerpt.
        message: String,
    },
    /// The file has no effect.
    #[error("{}: has no effect: write a section [[effect]] with name, hook, formula and parameters", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Two effects have one name.
    #[error("{}: two effects are named '{name}'", path.display())]
    Repeated {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// An effect is at fault.
    #[error("{}: {error}", path.display())]
    Effect {
        /// The file.
        path: PathBuf,
        /// Why.
        error: Box<FormulaError>,
    },
}
