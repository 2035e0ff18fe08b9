//! Files of formulas: TOML with one `[[effect]]` for each.

use std::io::Read;
use std::path::{Path, PathBuf};

use depthcal_model::FormulaDefinition;
use serde::{Deserialize, Serialize};

use crate::effect::FormulaEffect;
use crate::error::{FormulaError, FormulaFileError};

/// The effects of a file of formulas.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaFile {
    effects: Vec<FormulaEffect>,
}

/// The file's content.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Content {
    #[serde(default)]
    effect: Vec<FormulaDefinition>,
}

/// Largest file that is read, bytes.
const LARGEST: u64 = 1 << 20;

impl FormulaFile {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`FormulaFileError`], with line and column where a formula is at fault.
    pub fn read(path: &Path) -> Result<Self, FormulaFileError> {
        let cannot = |source| FormulaFileError::Read { path: path.to_owned(), source };
        let mut text = String::new();
        let file = std::fs::File::open(path).map_err(cannot)?;
        file.take(LARGEST + 1).read_to_string(&mut text).map_err(cannot)?;
        if text.len() as u64 > LARGEST {
            return Err(FormulaFileError::TooLarge { path: path.to_owned(), limit: LARGEST });
        }
        Self::parse_named(&text, path)
    }

    /// The effects of a text in memory.
    ///
    /// # Errors
    ///
    /// [`FormulaFileError`], as for a file named `formula`.
    pub fn parse(text: &str) -> Result<Self, FormulaFileError> {
        Self::parse_named(text, Path::new("formula"))
    }

    fn parse_named(text: &str, path: &Path) -> Result<Self, FormulaFileError> {
        let path = || PathBuf::from(path);
        let content: Content = toml::from_str(text).map_err(|error| FormulaFileError::Toml {
            path: path(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        if content.effect.is_empty() {
            return Err(FormulaFileError::Empty { path: path() });
        }
        let mut effects: Vec<FormulaEffect> = Vec::new();
        for definition in content.effect {
            if effects.iter().any(|effect| effect.name() == definition.name) {
                return Err(FormulaFileError::Repeated { path: path(), name: definition.name });
            }
            let effect = FormulaEffect::new(definition)
                .map_err(|error| FormulaFileError::Effect { path: path(), error: Box::new(in_file(error, text)) })?;
            effects.push(effect);
        }
        Ok(Self { effects })
    }

    /// Its effects, in order; at least one.
    pub fn effects(&self) -> &[FormulaEffect] {
        &self.effects
    }
}

/// A file with these effects.
pub fn file_text(effects: &[FormulaEffect]) -> String {
    let effect = effects.iter().map(|effect| effect.definition().clone()).collect();
    toml::to_string(&Content { effect }).unwrap_or_default()
}

/// The error with line and column in the file, where the formula's text stands in it as it is.
fn in_file(error: FormulaError, file: &str) -> FormulaError {
    let FormulaError::Text { effect, field, line, column, problem, excerpt } = error else { return error };
    // The line of the excerpt is a line of the file, or a part of one.
    let written = excerpt.lines().next().unwrap_or_default().trim_start_matches("    ");
    let of_effect = file.find(&format!("\"{effect}\"")).unwrap_or(0);
    // The effect's section may begin above its name.
    let section = file[..of_effect].rfind("[[").unwrap_or(0);
    let (line, column) = match file[section..].find(written).filter(|_| !written.is_empty()) {
        Some(at) => {
            let before = &file[..section + at];
            let line = before.matches('\n').count() + 1;
            (line, before.rsplit('\n').next().map_or(0, |beginning| beginning.chars().count()) + column)
        }
        None => (line, column),
    };
    FormulaError::Text { effect, field, line, column, problem, excerpt }
}
