//! Specifications of pieces and depth models: the name of a piece with the parameters that are free and the values of its
//! constants, and a stack of such. On the command line, in option structs and in files they are text, which is parsed once.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::piece::{AnyPiece, Options, Parameter, Placement, worded};

/// Reason why text is no specification. Whether a piece of that name exists is known to the register only
/// ([`RegisterError`](crate::RegisterError)).
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SpecError {
    /// There is no name.
    #[error("'{spec}' names no piece: write NAME, NAME:SUBSET or NAME@CONSTANT=NUMBER")]
    NoName {
        /// The text.
        spec: String,
    },
    /// The text after an `@` is no constant with a number.
    #[error("'{given}' sets no constant of '{name}': write {name}@CONSTANT=NUMBER")]
    BadConstant {
        /// The piece.
        name: String,
        /// The text after the `@`.
        given: String,
    },
    /// The text after `@of=` or `@on=` is no place and no form.
    #[error(
        "'{given}' is no place or form of '{name}': write {name}@of=true or @of=measured, and @on=depth, @on=inverse_depth or \
         @on=factor"
    )]
    BadPlacement {
        /// The piece.
        name: String,
        /// The text after the `@`.
        given: String,
    },
}

/// The parameters of a piece that may be fitted.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub enum FreeSubset {
    /// All of them.
    #[default]
    All,
    /// Those whose names end with one of these letters: `xw` of dx, dy, dz, dw. The others keep their nominal values.
    Ending(String),
}

impl FreeSubset {
    /// Which of `parameters` are free.
    ///
    /// # Errors
    ///
    /// The first letter with which no name ends.
    pub fn mask(&self, parameters: &[Parameter]) -> Result<Vec<bool>, char> {
        let Self::Ending(letters) = self else { return Ok(vec![true; parameters.len()]) };
        match letters.chars().find(|c| !parameters.iter().any(|p| p.name.ends_with(*c))) {
            Some(unknown) => Err(unknown),
            None => Ok(parameters.iter().map(|p| letters.chars().any(|c| p.name.ends_with(c))).collect()),
        }
    }
}

/// A piece as users ask for it: `NAME`, `NAME:SUBSET` (only these parameters free), `NAME@CONSTANT=NUMBER` (a constant of the
/// piece, several with further `@`). An effect of depth also takes its place, `NAME@of=measured`, and its form,
/// `NAME@on=inverse_depth` ([`Placement`]).
///
/// ```
/// use depthcal_model::PieceSpec;
///
/// let spec: PieceSpec = "cyclic_depth@period_mm=280".parse()?;
/// assert_eq!((spec.name.as_str(), spec.constants["period_mm"]), ("cyclic_depth", 280.0));
/// assert_eq!(spec.to_string(), "cyclic_depth@period_mm=280");
/// # Ok::<(), depthcal_model::SpecError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct PieceSpec {
    /// Name of the piece.
    pub name: String,
    /// Its free parameters.
    pub free: FreeSubset,
    /// Place and form, for an effect of depth.
    pub placement: Placement,
    /// Values of constants by name; the others have their defaults.
    pub constants: Options,
}

impl PieceSpec {
    /// A piece with all parameters free and default constants.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), free: FreeSubset::All, placement: Placement::default(), constants: Options::new() }
    }

    /// Frees only those parameters whose names end with one of `letters`.
    #[must_use]
    pub fn only(mut self, letters: impl Into<String>) -> Self {
        self.free = FreeSubset::Ending(letters.into());
        self
    }

    /// Sets place and form.
    #[must_use]
    pub fn placed(mut self, placement: Placement) -> Self {
        self.placement = placement;
        self
    }

    /// Sets a constant.
    #[must_use]
    pub fn with(mut self, constant: impl Into<String>, value: f64) -> Self {
        self.constants.insert(constant.into(), value);
        self
    }

    /// The specification for people, `cyclic_depth (period 300 mm)`: constants with three significant digits and the words and
    /// units that `piece` declares. [`Register::words`](crate::Register::words) finds the piece.
    pub fn words(&self, piece: Option<&dyn AnyPiece>) -> String {
        let declared = piece.map(AnyPiece::constants).unwrap_or_default();
        let subset = match &self.free {
            FreeSubset::All => None,
            FreeSubset::Ending(letters) => {
                Some(format!("only {} free", letters.chars().map(String::from).collect::<Vec<_>>().join(", ")))
            }
        };
        let constants = self.constants.iter().map(|(name, value)| match declared.iter().find(|c| c.name == name) {
            Some(constant) => constant.words(*value),
            None => worded(&name.replace('_', " "), *value, "1"),
        });
        let details: Vec<String> = subset.into_iter().chain(self.placement.words()).chain(constants).collect();
        if details.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, details.join(", ")) }
    }
}

impl fmt::Display for PieceSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if let FreeSubset::Ending(letters) = &self.free {
            write!(f, ":{letters}")?;
        }
        self.placement.fmt(f)?;
        self.constants.iter().try_for_each(|(name, value)| write!(f, "@{name}={value}"))
    }
}

impl FromStr for PieceSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let mut parts = text.split('@');
        let head = parts.next().unwrap_or_default();
        let (name, free) = match head.split_once(':') {
            Some((name, letters)) => (name, FreeSubset::Ending(letters.to_owned())),
            None => (head, FreeSubset::All),
        };
        if name.is_empty() {
            return Err(SpecError::NoName { spec: text.to_owned() });
        }
        let (mut constants, mut placement) = (Options::new(), Placement::default());
        for part in parts {
            let bad = |_| SpecError::BadPlacement { name: name.to_owned(), given: part.to_owned() };
            match part.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
                Some(("of", value)) => {
                    placement.of = value.parse().map_err(bad)?;
                    continue;
                }
                Some(("on", value)) => {
                    placement.on = Some(value.parse().map_err(bad)?);
                    continue;
                }
                _ => {}
            }
            let constant = part.split_once('=').and_then(|(k, v)| Some((k.trim(), v.trim().parse::<f64>().ok()?)));
            let Some((key, value)) = constant.filter(|(key, value)| !key.is_empty() && !value.is_nan()) else {
                return Err(SpecError::BadConstant { name: name.to_owned(), given: part.to_owned() });
            };
            constants.insert(key.to_owned(), value);
        }
        Ok(Self { name: name.to_owned(), free, placement, constants })
    }
}

impl TryFrom<String> for PieceSpec {
    type Error = SpecError;

    fn try_from(text: String) -> Result<Self, SpecError> {
        text.parse()
    }
}

impl From<PieceSpec> for String {
    fn from(spec: PieceSpec) -> Self {
        spec.to_string()
    }
}

/// A depth model as users ask for it: depth pieces joined by `+`, in the order in which they act: `projective:xw+bspline`;
/// `none` for no piece.
///
/// ```
/// use depthcal_model::ModelSpec;
///
/// let spec: ModelSpec = "projective:xw + bspline".parse()?;
/// assert_eq!(spec.pieces[1].name, "bspline");
/// assert_eq!(spec.to_string(), "projective:xw+bspline");
/// # Ok::<(), depthcal_model::SpecError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ModelSpec {
    /// Whether nothing is to be added to the pieces: written as a part `none`. Without it
    /// [`Register::depth_blocks`](crate::Register::depth_blocks) gives a map of offsets its scale and offset.
    pub bare: bool,
    /// The pieces in order.
    pub pieces: Vec<PieceSpec>,
}

impl ModelSpec {
    /// The model without any piece, `none`.
    pub fn none() -> Self {
        Self { bare: true, pieces: Vec::new() }
    }

    /// The model of one piece.
    pub fn of(piece: PieceSpec) -> Self {
        Self { bare: false, pieces: vec![piece] }
    }

    /// Whether it has no piece at all.
    pub fn is_none(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Whether it has a piece of that name.
    pub fn has(&self, name: &str) -> bool {
        self.pieces.iter().any(|piece| piece.name == name)
    }
}

impl fmt::Display for ModelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let none = (self.bare || self.pieces.is_empty()).then(|| "none".to_owned());
        let parts: Vec<String> = none.into_iter().chain(self.pieces.iter().map(PieceSpec::to_string)).collect();
        f.write_str(&parts.join("+"))
    }
}

impl FromStr for ModelSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let parts = || text.split('+').map(str::trim);
        let pieces = parts().filter(|part| *part != "none").map(str::parse).collect::<Result<_, _>>()?;
        Ok(Self { bare: parts().any(|part| part == "none"), pieces })
    }
}

impl TryFrom<String> for ModelSpec {
    type Error = SpecError;

    fn try_from(text: String) -> Result<Self, SpecError> {
        text.parse()
    }
}

impl From<ModelSpec> for String {
    fn from(spec: ModelSpec) -> Self {
        spec.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_specification_round_trip() {
        for text in [
            "projective",
            "projective:xw",
            "cyclic_depth@period_mm=299.90356313997415",
            "a:@b=-1@c=inf",
            "cyclic_depth:1@of=measured@on=inverse_depth@period_mm=280",
        ] {
            assert_eq!(text.parse::<PieceSpec>().unwrap().to_string(), text);
        }
        for text in ["none", "projective:xw+bspline@columns=6@rows=5", "none+disparity_decay"] {
            assert_eq!(text.parse::<ModelSpec>().unwrap().to_string(), text);
        }
        assert_eq!("free_map+none".parse::<ModelSpec>().unwrap().to_string(), "none+free_map");
        assert_eq!("none".parse::<ModelSpec>(), Ok(ModelSpec::none()));
        assert!(ModelSpec::none().is_none() && !ModelSpec::of(PieceSpec::new("projective")).is_none());
    }

    #[test]
    fn bad_text_is_refused_with_what_is_wrong() {
        let message = |text: &str| text.parse::<ModelSpec>().unwrap_err().to_string();
        assert!(message("projective++bspline").contains("'' names no piece"), "{}", message("projective++bspline"));
        assert!(message(":xw").contains("':xw' names no piece"), "{}", message(":xw"));
        for given in ["period_mm=x", "period_mm", "=3", "period_mm=NaN", ""] {
            let text = format!("projective+cyclic_depth@{given}");
            let expected = format!("'{given}' sets no constant of 'cyclic_depth': write cyclic_depth@CONSTANT=NUMBER");
            assert_eq!(message(&text), expected);
        }
        let placed = message("cyclic_depth@of=raw");
        assert!(placed.starts_with("'of=raw' is no place or form of 'cyclic_depth': write"), "{placed}");
    }
}
