//! Formulas, alone and in files.

use std::collections::BTreeMap;

use depthcal_formula::{FormulaEffect, FormulaFile, file_text};

/// A file of formulas.
pub fn formula_file(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(file) = FormulaFile::parse(text) {
        file.effects().iter().for_each(used);
        let again =
            FormulaFile::parse(&file_text(file.effects())).expect("a file of formulas that was written is read");
        assert_eq!(file, again);
    }
}

/// The text of a formula, with parameters and constants of some units.
pub fn formula_text(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let quoted = toml_string(text);
    let file = format!(
        "[[effect]]\nname = \"fuzzed\"\nhook = \"depth\"\nadds_to = \"inverse_depth\"\nformula = {quoted}\n\
         parameters = {{ a = \"1/mm\", b = \"1\" }}\nconstants = {{ rho0 = 0.00125, n = 2.0 }}\n"
    );
    formula_file(file.as_bytes());
    let one = file.replace("a = \"1/mm\", b = \"1\"", "a = \"1/mm\"").replace(", n = 2.0", "");
    formula_file(one.as_bytes());
}

/// Everything that is made of an effect.
fn used(effect: &FormulaEffect) {
    let printed = [effect.text(), effect.latex(), effect.mathml(), effect.rust()];
    assert!(printed.iter().all(|text| !text.is_empty()));
    let function = effect.function();
    let theta = vec![0.5; effect.definition().parameters.len()];
    let covariates = vec![0.25; function.covariates().len()];
    // Any value will do, NaN too.
    let _ = function.values(&theta, &covariates);
    let _ = effect.piece(&BTreeMap::new()).parameters().len();
}

fn toml_string(text: &str) -> String {
    let escaped: String = text
        .chars()
        .flat_map(|c| match c {
            '"' | '\\' => vec!['\\', c],
            c if c.is_control() => format!("\\u{:04x}", c as u32).chars().collect(),
            c => vec![c],
        })
        .collect();
    format!("\"{escaped}\"")
}
