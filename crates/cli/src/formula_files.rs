//! Files of formulas of the command line.

use std::path::Path;

use depthcal_formula::{FormulaEffect, FormulaFile};
use depthcal_model::Register;

use super::failure::{Failure, input};

/// The effects of a file.
pub(super) fn read(path: &Path) -> Result<Vec<FormulaEffect>, Failure> {
    Ok(FormulaFile::read(path).map_err(input)?.effects().to_vec())
}

/// [`depthcal_formula::resolve`].
pub(super) fn resolve(option: &str, texts: &[String], register: &mut Register) -> Result<Vec<String>, Failure> {
    depthcal_formula::resolve(option, texts, register).map_err(input)
}

/// [`depthcal_formula::resolve_model`].
pub(super) fn resolve_model(option: &str, text: &str, register: &mut Register) -> Result<String, Failure> {
    depthcal_formula::resolve_model(option, text, register).map_err(input)
}

/// [`depthcal_formula::resolve_lens`].
pub(super) fn resolve_lens(
    option: &str,
    lens: Option<&str>,
    register: &mut Register,
) -> Result<Option<String>, Failure> {
    depthcal_formula::resolve_lens(option, lens, register).map_err(input)
}
