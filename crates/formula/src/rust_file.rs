//! Formulas as Rust files.

use crate::effect::FormulaEffect;
use crate::file::file_text;

impl FormulaEffect {
    /// A Rust file for a program with effects of its own: the definition as text, and a function `add` that adds it to a register.
    ///
    /// The formula is as fast as a piece in Rust would be, so the file has no code of its own for it.
    pub fn rust(&self) -> String {
        let (name, definition) = (self.name(), file_text(std::slice::from_ref(self)));
        // As many as no text in the definition ends a string with.
        let mut hashes = "#".to_owned();
        while definition.contains(&format!("\"{hashes}")) {
            hashes.push('#');
        }
        let equation = self.text();
        format!(
            "//! The effect `{name}`: {equation}
//!
//! `mod {name};` and `{name}::add(&mut register)?` in a program that runs `depthcal::cli::run(register)` make every command know it.

use depthcal::Register;
use depthcal::formula::FormulaFile;

/// The effect as in a file for `--with`.
const DEFINITION: &str = r{hashes}\"
{definition}\"{hashes};

/// Adds the effect to a register.
///
/// # Errors
///
/// If a piece that is no formula has its name.
pub fn add(register: &mut Register) -> Result<(), Box<dyn std::error::Error>> {{
    for effect in FormulaFile::parse(DEFINITION)?.effects() {{
        effect.register(register)?;
    }}
    Ok(())
}}
"
        )
    }
}
