//! Files of formulas where the command line takes the name of an effect.

use std::path::Path;

use depthcal_formula::{FormulaEffect, FormulaFile};
use depthcal_model::{AnyPiece, Register};

use super::failure::{Failure, input};

/// The end of the names of such files.
const ENDING: &str = ".toml";

/// The effects of a file.
pub(super) fn read(path: &Path) -> Result<Vec<FormulaEffect>, Failure> {
    Ok(FormulaFile::read(path).map_err(input)?.effects().to_vec())
}

/// Texts with the names of effects instead of files of formulas, `FILE.toml` or `FILE.toml:SUBSET@CONSTANT=NUMBER`; the effects are
/// added to the register. Other texts stay.
pub(super) fn resolve(option: &str, texts: &[String], register: &mut Register) -> Result<Vec<String>, Failure> {
    let mut resolved = Vec::new();
    for text in texts {
        let Some((path, suffix)) = split(text) else {
            resolved.push(text.clone());
            continue;
        };
        let effects = read(Path::new(path))?;
        if effects.len() > 1 && !suffix.is_empty() {
            return Err(Failure::Input(format!(
                "{option} {text}: {path} has {} effects, so '{suffix}' could be of any: give each effect a file of its own",
                effects.len()
            )));
        }
        for effect in effects {
            effect.register(register).map_err(|e| Failure::Input(format!("{option} {path}: {e}")))?;
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
pub(super) fn resolve_model(option: &str, text: &str, register: &mut Register) -> Result<String, Failure> {
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

/// The values of a formula's parameters, where its file has all of them.
pub(super) fn values(piece: &dyn AnyPiece) -> Option<Vec<f64>> {
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
