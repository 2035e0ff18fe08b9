//! The effect `row_gain`: ρ + a y ln(ρ/ρ₀)
//!
//! With `mod row_gain;` and `row_gain::add(&mut register)?` in a program that runs `depthcal::cli::run(register)`, every command
//! knows it.

use depthcal::Register;
use depthcal::formula::FormulaFile;

/// The effect as in a file for `--with`.
const DEFINITION: &str = r#"
[[effect]]
name = "row_gain"
hook = "depth"
adds_to = "inverse_depth"
of = "measured"
formula = "a * y * log(rho / rho0)"

[effect.parameters.a]
unit = "1/mm"
value = 0.00003

[effect.constants]
rho0 = 0.00125
"#;

/// Adds the effect to a register.
///
/// # Errors
///
/// If a piece that is not a formula has its name.
pub fn add(register: &mut Register) -> Result<(), Box<dyn std::error::Error>> {
    for effect in FormulaFile::parse(DEFINITION)?.effects() {
        effect.register(register)?;
    }
    Ok(())
}
