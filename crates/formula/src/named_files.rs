//! Files of formulas where a program takes the name of an effect.

use std::path::Path;

use depthcal_model::{AnyPiece, Register};
use thiserror::Error;

use crate::effect::FormulaEffect;
use crate::error::{FormulaError, FormulaFileError};
use crate::file::FormulaFile;

/// The end of the names of such files.
const ENDING: &str = ".toml";

/// Why the file that an option names gives no effects.
#[derive(Debug, Error)]
pub enum NamedFileError {
    /// The file is at fault.
    #[error(transparent)]
    File(#[from] FormulaFileError),
    /// Place, form or constants for one of several effects.
    #[error(
        "{option} {text}: {path} has {effects} effects, so '{suffix}' could be of any: give each effect a file of its own"
    )]
    Ambiguous {
        /// Name of the option.
        option: String,
        /// Its text.
        text: String,
        /// The file.
        path: String,
        /// Number of its effects.
        effects: usize,
        /// The text behind the name of the file.
        suffix: String,
    },
    /// An effect cannot be registered.
    #[error("{option} {path}: {error}")]
    Register {
        /// Name of the option.
        option: String,
        /// The file.
        path: String,
        /// Why.
        error: Box<FormulaError>,
    },
}

/// A lens model with the name of its effect instead of the file of a formula, as [`resolve`] does with lists.
///
/// # Errors
///
/// [`NamedFileError`].
pub fn resolve_lens(
    option: &str,
    lens: Option<&str>,
    register: &mut Register,
) -> Result<Option<String>, NamedFileError> {
    let given: Vec<String> = lens.iter().map(|lens| (*lens).to_owned()).collect();
    Ok(resolve(option, &given, register)?.pop())
}

/// Texts with the names of effects instead of files of formulas, `FILE.toml` or `FILE.toml:SUBSET@CONSTANT=NUMBER`; the effects
/// are added to the register. Other texts stay. `option` is what the user calls the list.
///
/// # Errors
///
/// [`NamedFileError`].
pub fn resolve(option: &str, texts: &[String], register: &mut Register) -> Result<Vec<String>, NamedFileError> {
    let mut resolved = Vec::new();
    for text in texts {
        let Some((path, suffix)) = split(text) else {
            resolved.push(text.clone());
            continue;
        };
        let file = FormulaFile::read(Path::new(path))?;
        if file.effects().len() > 1 && !suffix.is_empty() {
            return Err(NamedFileError::Ambiguous {
                option: option.to_owned(),
                text: text.clone(),
                path: path.to_owned(),
                effects: file.effects().len(),
                suffix: suffix.to_owned(),
            });
        }
        for effect in file.effects() {
            effect.register(register).map_err(|error| NamedFileError::Register {
                option: option.to_owned(),
                path: path.to_owned(),
                error: Box::new(error),
            })?;
            let mut spec = effect.spec().to_string();
            if !suffix.is_empty() {
                // What the text says of place and form takes the place of what the file says.
                spec = format!("{}{suffix}", effect.name());
            }
            resolved.push(spec);
        }
    }
    Ok(resolved)
}

/// A model such as `projective+FILE.toml` with the names of effects instead of files.
///
/// # Errors
///
/// [`NamedFileError`].
pub fn resolve_model(option: &str, text: &str, register: &mut Register) -> Result<String, NamedFileError> {
    if split(text).is_none() {
        return Ok(text.to_owned());
    }
    let parts: Vec<String> = text.split('+').map(|part| part.trim().to_owned()).collect();
    Ok(resolve(option, &parts, register)?.join("+"))
}

/// The path of a file of formulas and what follows it.
fn split(text: &str) -> Option<(&str, &str)> {
    let end = text.find(ENDING)? + ENDING.len();
    let (path, suffix) = text.split_at(end);
    (suffix.is_empty() || suffix.starts_with([':', '@', '+'])).then_some((path, suffix))
}

/// The values of a formula's parameters, where its definition has all of them.
pub fn values(piece: &dyn AnyPiece) -> Option<Vec<f64>> {
    FormulaEffect::new(piece.formula()?.clone()).ok()?.values()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_end_before_subsets_and_constants() {
        assert_eq!(split("a/b.toml"), Some(("a/b.toml", "")));
        assert_eq!(split("b.toml:xw@p=3"), Some(("b.toml", ":xw@p=3")));
        assert_eq!(split("cyclic_depth@p=3"), None);
        assert_eq!(split("b.tomlx"), None);
    }
}
