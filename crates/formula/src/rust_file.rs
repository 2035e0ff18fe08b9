//! Formulas as Rust files.

use crate::effect::FormulaEffect;
use crate::file::file_text;

impl FormulaEffect {
    /// A Rust file for a program with effects of its own: the definition as text, and a function `add` that adds it to a
    /// register. A formula is evaluated as fast as a piece in Rust, so the file does not translate it.
    pub fn rust(&self) -> String {
        let (name, definition) = (self.name(), file_text(std::slice::from_ref(self)));
        // More `#` than follow any quotation mark of the definition, which then cannot end the string.
        let mut hashes = "#".to_owned();
        while definition.contains(&format!("\"{hashes}")) {
            hashes.push('#');
        }
        let equation = self.text();
        format!(
            "//! The effect `{name}`: {equation}
//!
//! With `mod {name};` and `{name}::add(&mut register)?` in a program that runs `depthcal::cli::run(register)`, every command
//! knows it.

use depthcal::Register;
use depthcal::formula::FormulaFile;

/// The effect as in a file for `--with`.
const DEFINITION: &str = r{hashes}\"
{definition}\"{hashes};

/// Adds the effect to a register.
///
/// # Errors
///
/// If a piece that is not a formula has its name.
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
