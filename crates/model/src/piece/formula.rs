//! An effect given as a formula, as files have it. `depthcal-formula` checks it and makes a piece of it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::placement::Of;
use super::smooth::SmoothParameters;
use crate::hook::HookKind;

/// An effect given as a formula instead of Rust: an entry `[[effect]]` of a file of formulas, and of a piece in
/// `calibration.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FormulaDefinition {
    /// Name of the piece: small letters, digits and underscores.
    pub name: String,
    /// Where it acts: `depth`, `lens`, `pixel` or `board`.
    pub hook: HookKind,
    /// The quantity that the value of the formula is added to; the first of its hook where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adds_to: Option<AddsTo>,
    /// For an effect of depth, the state from which the covariates are taken.
    #[serde(default, skip_serializing_if = "is_true_state")]
    pub of: Of,
    /// The formula, in terms of covariates, parameters and constants. Two, for x and y or for u and v, where both change.
    pub formula: FormulaText,
    /// The fitted parameters by name, in alphabetical order. At their nominal values the formula is zero.
    pub parameters: BTreeMap<String, FormulaParameter>,
    /// Parameters that are coefficients of a spline, with how smooth it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub smooth: Vec<SmoothParameters>,
    /// Numbers that are not fitted, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub constants: BTreeMap<String, FormulaConstant>,
    /// Summary in plain words, without a full stop.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub summary: String,
    /// Where the equation comes from.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
}

/// One formula, or one for each of two coordinates.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum FormulaText {
    /// A single formula.
    One(String),
    /// One formula for each coordinate.
    Two([String; 2]),
}

impl FormulaText {
    /// The texts in order.
    pub fn texts(&self) -> &[String] {
        match self {
            Self::One(text) => std::slice::from_ref(text),
            Self::Two(texts) => texts,
        }
    }
}

/// The quantity that a formula's value is added to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AddsTo {
    /// Depth, mm: z + e.
    Depth,
    /// Inverse depth, 1/mm: ρ + e.
    InverseDepth,
    /// The factor of depth, z (1 + e), or of the magnification of the lens, (x, y) (1 + e).
    Factor,
    /// The first normalised image coordinate, or the first coordinate of the board, mm.
    X,
    /// The second normalised image coordinate, or the second coordinate of the board, mm.
    Y,
    /// Both normalised image coordinates, one formula each.
    Xy,
    /// The height of the board over its plane, mm; positive away from a viewer who looks at the print.
    Z,
    /// The column in the depth image, px.
    U,
    /// The row in the depth image, px.
    V,
    /// Column and row in the depth image, px, one formula each.
    Uv,
}

/// A fitted parameter of a formula: its unit, or a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum FormulaParameter {
    /// The unit; the nominal value is 0.
    Unit(String),
    /// Unit and more.
    Table(ParameterTable),
}

/// A fitted parameter of a formula with all that can be said of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterTable {
    /// Unit, such as `mm`, `1/mm` or `mm/°C`; `1` for none.
    pub unit: String,
    /// Value at which the effect is zero.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub nominal: f64,
    /// Typical deviation from nominal; derived from the formula where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Value in simulations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Meaning for a person with a camera and a board.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub meaning: String,
}

impl FormulaParameter {
    /// The parameter as a table.
    pub fn table(&self) -> ParameterTable {
        match self {
            Self::Unit(unit) => {
                ParameterTable { unit: unit.clone(), nominal: 0.0, scale: None, value: None, meaning: String::new() }
            }
            Self::Table(table) => table.clone(),
        }
    }
}

/// A number of a formula that is not fitted: its value, or a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum FormulaConstant {
    /// The value, in the unit that the formula asks for.
    Value(f64),
    /// Value and more.
    Table(ConstantTable),
}

/// A number of a formula that is not fitted, with all that can be said of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantTable {
    /// The value.
    pub value: f64,
    /// Unit; the one that the formula asks for where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Its role, where a search for missing effects may vary it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<FormulaSearch>,
}

/// The role of a searched constant ([`ScanKind`](super::ScanKind)).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FormulaSearch {
    /// Period of a wave.
    Period,
    /// Time constant of an exponential.
    TimeConstant,
    /// Value of the covariate at which the effect is zero.
    Reference,
}

impl FormulaConstant {
    /// The value.
    pub fn value(&self) -> f64 {
        match self {
            Self::Value(value) => *value,
            Self::Table(table) => table.value,
        }
    }

    /// A copy with another value.
    #[must_use]
    pub fn with_value(&self, value: f64) -> Self {
        match self {
            Self::Value(_) => Self::Value(value),
            Self::Table(table) => Self::Table(ConstantTable { value, ..table.clone() }),
        }
    }

    /// The declared unit.
    pub fn unit(&self) -> Option<&str> {
        match self {
            Self::Value(_) => None,
            Self::Table(table) => table.unit.as_deref(),
        }
    }

    /// Its role in a search.
    pub fn search(&self) -> Option<FormulaSearch> {
        match self {
            Self::Value(_) => None,
            Self::Table(table) => table.search,
        }
    }
}

fn is_true_state(state: &Of) -> bool {
    *state == Of::True
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number that is left out of a file is zero when it is read, and nothing else is left out.
    #[test]
    fn only_what_says_nothing_is_left_out() {
        let parameter = |nominal| {
            let (unit, meaning) = ("mm".to_owned(), String::new());
            ParameterTable { unit, nominal, scale: None, value: None, meaning }
        };
        assert_eq!(serde_json::to_string(&parameter(0.0)).unwrap(), r#"{"unit":"mm"}"#);
        for nominal in [1.0, -2.5, 1e-12] {
            let text = serde_json::to_string(&parameter(nominal)).unwrap();
            assert_eq!(serde_json::from_str::<ParameterTable>(&text).unwrap(), parameter(nominal), "{text}");
        }
    }

    #[test]
    fn a_file_has_one_formula_or_one_for_each_coordinate() {
        let texts = |json: &str| serde_json::from_str::<FormulaText>(json).unwrap().texts().to_vec();
        assert_eq!(texts(r#""a*z""#), ["a*z"]);
        assert_eq!(texts(r#"["a*x", "a*y"]"#), ["a*x", "a*y"]);
        assert!(serde_json::from_str::<FormulaText>(r#"["a*x", "a*y", "a"]"#).is_err());
    }

    #[test]
    fn short_forms_are_those_of_the_tables() {
        let table = FormulaParameter::Unit("mm".to_owned()).table();
        assert_eq!((table.unit.as_str(), table.nominal, table.scale), ("mm", 0.0, None));
        let search = Some(FormulaSearch::Period);
        let long = FormulaConstant::Table(ConstantTable { value: 3.0, unit: Some("mm".to_owned()), search });
        let short = FormulaConstant::Value(3.0);
        assert_eq!([long.value(), short.value(), long.with_value(4.0).value()], [3.0, 3.0, 4.0]);
        assert_eq!((long.unit(), short.unit()), (Some("mm"), None));
        assert_eq!((long.with_value(4.0).search(), short.search()), (search, None));
    }
}
