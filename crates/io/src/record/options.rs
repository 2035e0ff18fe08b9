//! Values of a piece's options by name. A drift that does not settle has the time constant ∞, for which JSON has no number: it is
//! `"inf"` there.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A value as files have it.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub(super) enum OptionValue {
    /// A finite value.
    Finite(f64),
    /// The value ∞.
    Infinite(Infinite),
}

/// The word for ∞.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, schemars::JsonSchema)]
pub(super) enum Infinite {
    /// Larger than any number.
    #[serde(rename = "inf")]
    Inf,
}

/// Writes options.
pub(super) fn serialize<S: Serializer>(options: &BTreeMap<String, f64>, serializer: S) -> Result<S::Ok, S::Error> {
    let value = |value: f64| {
        if value == f64::INFINITY { OptionValue::Infinite(Infinite::Inf) } else { OptionValue::Finite(value) }
    };
    serializer.collect_map(options.iter().map(|(name, option)| (name, value(*option))))
}

/// Reads options.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let options = BTreeMap::<String, OptionValue>::deserialize(deserializer)?;
    let value = |value| match value {
        OptionValue::Finite(value) => value,
        OptionValue::Infinite(Infinite::Inf) => f64::INFINITY,
    };
    Ok(options.into_iter().map(|(name, option)| (name, value(option))).collect())
}
