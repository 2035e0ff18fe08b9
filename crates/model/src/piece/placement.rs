//! Place and form of an effect of depth: from which state it takes its covariates, and what its shape is added to.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Depth at which an effect has the same size in all forms, mm.
pub const REFERENCE_DEPTH_MM: f64 = 1000.0;

/// The state from which an effect of depth takes its covariates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// The true depth: the effect acts where the chain of pieces has it, before the depth model.
    #[default]
    True,
    /// The depth that the rest of the model says the camera measures: the effect acts after the depth model.
    Measured,
}

/// The quantity that the shape of an effect of depth is added to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum On {
    /// Depth: z + e.
    #[default]
    Depth,
    /// Inverse depth: ρ − e / z₀², with the size e of the effect at the depth z₀ ([`REFERENCE_DEPTH_MM`]).
    InverseDepth,
    /// The factor of depth: z (1 + e / z₀).
    Factor,
}

/// Place and form of an effect of depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Placement {
    /// Where it acts.
    pub of: Of,
    /// How; `None` is the form of the piece's own equation.
    pub on: Option<On>,
}

/// Text that is no place and no form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownPlacement;

impl Of {
    /// Both places.
    pub const ALL: [Self; 2] = [Self::True, Self::Measured];

    /// As in specifications and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::Measured => "measured",
        }
    }

    /// For people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::True => "before the depth model",
            Self::Measured => "after the depth model",
        }
    }
}

impl On {
    /// All forms.
    pub const ALL: [Self; 3] = [Self::Depth, Self::InverseDepth, Self::Factor];

    /// As in specifications and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::InverseDepth => "inverse_depth",
            Self::Factor => "factor",
        }
    }

    /// For people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Depth => "added to depth",
            Self::InverseDepth => "added to inverse depth",
            Self::Factor => "as a factor of depth",
        }
    }

    /// Size of a change of inverse depth from `rho` to `measured`, 1/mm, in this form: mm at [`REFERENCE_DEPTH_MM`].
    pub fn size_mm(self, rho: f64, measured: f64) -> f64 {
        self.size_with_derivatives(rho, measured).0
    }

    /// [`On::size_mm`] with its derivatives by both.
    #[inline(always)]
    pub(crate) fn size_with_derivatives(self, rho: f64, measured: f64) -> (f64, [f64; 2]) {
        const Z0: f64 = REFERENCE_DEPTH_MM;
        match self {
            Self::Depth => (1.0 / measured - 1.0 / rho, [1.0 / (rho * rho), -1.0 / (measured * measured)]),
            Self::InverseDepth => ((rho - measured) * Z0 * Z0, [Z0 * Z0, -Z0 * Z0]),
            Self::Factor => ((rho / measured - 1.0) * Z0, [Z0 / measured, -Z0 * rho / (measured * measured)]),
        }
    }

    /// Inverse depth `rho` changed by `size_mm` in this form, with its derivatives by both.
    #[inline(always)]
    pub(crate) fn apply(self, rho: f64, size_mm: f64) -> (f64, [f64; 2]) {
        const Z0: f64 = REFERENCE_DEPTH_MM;
        match self {
            Self::Depth => {
                let factor = 1.0 / (1.0 + size_mm * rho);
                (rho * factor, [factor * factor, -rho * rho * factor * factor])
            }
            Self::InverseDepth => (rho - size_mm / (Z0 * Z0), [1.0, -1.0 / (Z0 * Z0)]),
            Self::Factor => {
                let factor = 1.0 / (1.0 + size_mm / Z0);
                (rho * factor, [factor, -rho * factor * factor / Z0])
            }
        }
    }
}

impl Placement {
    /// Whether it is where the piece's own equation has the effect.
    pub fn is_own(&self) -> bool {
        *self == Self::default()
    }

    /// For people, in brackets after a name: `after the depth model, added to inverse depth`; empty where it is the piece's own.
    pub fn words(&self) -> Vec<String> {
        let state = (self.of == Of::Measured).then_some(self.of.words());
        state.into_iter().chain(self.on.map(On::words)).map(str::to_owned).collect()
    }
}

impl fmt::Display for Placement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.of == Of::Measured {
            write!(f, "@of={}", self.of.name())?;
        }
        self.on.map_or(Ok(()), |on| write!(f, "@on={}", on.name()))
    }
}

impl FromStr for Of {
    type Err = UnknownPlacement;

    fn from_str(text: &str) -> Result<Self, UnknownPlacement> {
        Self::ALL.into_iter().find(|state| state.name() == text).ok_or(UnknownPlacement)
    }
}

impl FromStr for On {
    type Err = UnknownPlacement;

    fn from_str(text: &str) -> Result<Self, UnknownPlacement> {
        Self::ALL.into_iter().find(|on| on.name() == text).ok_or(UnknownPlacement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of a report, and the texts of files and their inverses.
    #[test]
    fn places_and_forms_are_said_where_they_are_not_the_piece_s_own() {
        let placement = |state, on| Placement { of: state, on };
        assert!(placement(Of::True, None).is_own() && placement(Of::True, None).words().is_empty());
        let both = placement(Of::Measured, Some(On::InverseDepth));
        assert_eq!(both.words(), ["after the depth model", "added to inverse depth"]);
        assert_eq!(both.to_string(), "@of=measured@on=inverse_depth");
        assert_eq!(placement(Of::True, Some(On::Factor)).words(), ["as a factor of depth"]);
        assert_eq!(Of::True.words(), "before the depth model");
        assert!(Of::ALL.into_iter().all(|state| state.name().parse() == Ok(state)) && "depth".parse::<Of>().is_err());
        assert!(On::ALL.into_iter().all(|on| on.name().parse() == Ok(on)) && "true".parse::<On>().is_err());
    }

    /// A size of 4 mm at 1 m in each form, and back.
    #[test]
    fn sizes_are_those_at_the_reference_depth() {
        for (on, at_2_m) in [(On::Depth, 2004.0), (On::InverseDepth, 1.0 / (1.0 / 2000.0 - 4e-6)), (On::Factor, 2008.0)]
        {
            let (measured, _) = on.apply(1.0 / 2000.0, 4.0);
            assert!((1.0 / measured - at_2_m).abs() < 1e-9, "{}: {}", on.name(), 1.0 / measured);
            assert!((on.size_mm(1.0 / 2000.0, measured) - 4.0).abs() < 1e-9, "{}", on.name());
        }
    }
}
