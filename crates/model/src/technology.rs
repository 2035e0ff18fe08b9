use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The principle by which a depth camera measures. Some effects belong to one of them: light that went astray turns the phase
/// of a time-of-flight camera, and has no phase to turn where disparities are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Technology {
    /// The time that light takes, by its phase or by pulses.
    TimeOfFlight,
    /// The disparity of a projected pattern.
    StructuredLight,
    /// The disparity between two cameras, with or without a pattern.
    Stereo,
}

/// A name that is no [`Technology`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("'{given}' is no technology of a depth camera; give time-of-flight, structured-light or stereo")]
pub struct UnknownTechnology {
    /// The name.
    pub given: String,
}

impl Technology {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::TimeOfFlight, Self::StructuredLight, Self::Stereo];
    /// Those that measure a disparity.
    pub const OF_DISPARITY: &'static [Self] = &[Self::StructuredLight, Self::Stereo];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::TimeOfFlight => "time-of-flight",
            Self::StructuredLight => "structured-light",
            Self::Stereo => "stereo",
        }
    }
}

impl fmt::Display for Technology {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Technology {
    type Err = UnknownTechnology;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let of_name = Self::ALL.into_iter().find(|technology| technology.name() == text.replace('_', "-"));
        of_name.ok_or_else(|| UnknownTechnology { given: text.to_owned() })
    }
}
