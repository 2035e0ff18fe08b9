//! The files of a formula that was found.

use depthcal_formula::{FormulaEffect, file_text};

use crate::formula_plot::formula_plot;

/// Names and texts of an effect's files: its definition for `--with` (`NAME.toml`), a Rust file that adds it to a program
/// (`NAME.rs`) and its picture (`NAME.svg`).
pub fn effect_files(effect: &FormulaEffect) -> [(String, String); 3] {
    let name = effect.name();
    [
        (format!("{name}.toml"), file_text(std::slice::from_ref(effect))),
        (format!("{name}.rs"), effect.rust()),
        (format!("{name}.svg"), formula_plot(effect)),
    ]
}
