//! Descriptions of effects.

use std::collections::BTreeMap;

use super::sizing::Context;
use crate::error::SimulateError;
use crate::instrument::Instrument;

/// The description of an effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectInfo {
    /// Its name.
    pub name: &'static str,
    /// Hook at which it acts: `board`, `lens`, `pixel` or `depth`.
    pub hook: &'static str,
    /// Unit of its size: `mm`, `px` or `%`.
    pub unit: &'static str,
    /// A clearly visible yet realistic size.
    pub default_size: f64,
    /// Definition of the size.
    pub size_is: &'static str,
    /// Its form, in words or as a formula.
    pub form: &'static str,
    pub(super) install: Install,
}

/// Installs an effect of a given size in the instrument and returns its parameters.
pub(super) type Install = fn(&Context, f64, &mut Instrument) -> Result<Parameters, SimulateError>;

/// Parameters of an effect by name.
pub type Parameters = BTreeMap<String, f64>;

/// Parameters from pairs of name and value.
pub(super) fn parameters<const N: usize>(pairs: [(&str, f64); N]) -> Parameters {
    pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}
