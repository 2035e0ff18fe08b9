//! Names of formulas as symbols: `rho0` is ρ with index 0.

use crate::covariate::FormulaCovariate;

/// Greek letters by their names, with their LaTeX.
const GREEK: [(&str, &str); 24] = [
    ("alpha", "α"),
    ("beta", "β"),
    ("gamma", "γ"),
    ("delta", "δ"),
    ("epsilon", "ε"),
    ("zeta", "ζ"),
    ("eta", "η"),
    ("theta", "θ"),
    ("iota", "ι"),
    ("kappa", "κ"),
    ("lambda", "λ"),
    ("mu", "μ"),
    ("nu", "ν"),
    ("xi", "ξ"),
    ("pi", "π"),
    ("rho", "ρ"),
    ("sigma", "σ"),
    ("tau", "τ"),
    ("upsilon", "υ"),
    ("phi", "φ"),
    ("chi", "χ"),
    ("psi", "ψ"),
    ("omega", "ω"),
    ("ell", "ℓ"),
];

/// A symbol: its letters and its index, each perhaps the name of a Greek letter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Symbol {
    pub letters: String,
    pub index: String,
}

impl Symbol {
    /// The symbol of a name in a formula.
    pub fn of(name: &str) -> Self {
        let (letters, index) = match FormulaCovariate::reserved(name) {
            Some(covariate) => covariate.symbol(),
            None => {
                let end = name.find(|c: char| c == '_' || c.is_ascii_digit()).filter(|end| *end > 0);
                let (letters, index) = name.split_at(end.unwrap_or(name.len()));
                (letters, index.trim_start_matches('_'))
            }
        };
        Self { letters: letters.to_owned(), index: index.to_owned() }
    }

    /// The letters as characters.
    pub fn characters(&self) -> String {
        greek(&self.letters).unwrap_or(&self.letters).to_owned()
    }

    /// The index as characters.
    pub fn index_characters(&self) -> String {
        greek(&self.index).unwrap_or(&self.index).replace('_', ",")
    }

    /// The name of the Greek letter that it is, for LaTeX.
    pub fn greek_name(letters: &str) -> Option<&'static str> {
        GREEK.iter().find(|(name, letter)| *name == letters || *letter == letters).map(|(name, _)| *name)
    }
}

fn greek(name: &str) -> Option<&'static str> {
    GREEK.iter().find(|(n, _)| *n == name).map(|(_, letter)| *letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_symbols_with_indices() {
        let read = |name: &str| {
            let symbol = Symbol::of(name);
            (symbol.characters(), symbol.index_characters())
        };
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(read("rho0"), pair("ρ", "0"));
        assert_eq!(read("b_max"), pair("b", "max"));
        assert_eq!(read("temperature_c"), pair("T", ""));
        assert_eq!(read("tau_1_b"), pair("τ", "1,b"));
        assert_eq!(read("range"), pair("ℓ", ""));
    }
}
