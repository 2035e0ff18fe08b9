//! Dataset kinds: the distributions of board poses in the thesis' captures (Sjöholm 2017, section 6.1).

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::SimulateError;

/// Distribution of the board's poses over the frames of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Kind {
    /// Angles up to about 45° and distances from 0.3 to 1.5 m, everywhere in the image. The number distinguishes
    /// captures of the same seed; `general1` is the thesis'.
    General(u32),
    /// In the middle of the image, at varying distances and angles.
    Centered1,
    /// General poses, farther away (the thesis' larger plywood board).
    Longplywood1,
    /// As `longplywood1`, with few frames.
    Longplywood2,
    /// General poses, nearby.
    Plywood1,
    /// On the floor, 1 m away, parallel to the image.
    Sameheight1,
    /// Held by hand 0.5 m away, parallel to the image.
    Sameheight2,
    /// General poses, almost always in the left half of the image.
    Vertical1,
    /// Not of the thesis: so near that the board fills most of the image.
    Filling1,
}

impl Kind {
    /// The thesis' eight kinds.
    pub const ALL: [Self; 8] = [
        Self::General(1),
        Self::Centered1,
        Self::Longplywood1,
        Self::Longplywood2,
        Self::Plywood1,
        Self::Sameheight1,
        Self::Sameheight2,
        Self::Vertical1,
    ];

    /// Number of frames in the thesis' capture, or a usual one.
    pub fn frames(self) -> usize {
        match self {
            Self::General(_) | Self::Sameheight2 | Self::Filling1 => 27,
            Self::Centered1 => 18,
            Self::Longplywood1 => 12,
            Self::Longplywood2 => 6,
            Self::Plywood1 => 7,
            Self::Sameheight1 => 13,
            Self::Vertical1 => 25,
        }
    }

    /// Limits of the poses.
    pub(crate) fn placement(self) -> Placement {
        let general = Placement {
            near_mm: 300.0,
            far_mm: 1500.0,
            max_tilt_deg: 45.0,
            max_roll_deg: 30.0,
            region: [0.0, 0.0, 1.0, 1.0],
        };
        let parallel = |near_mm, far_mm| Placement { near_mm, far_mm, max_tilt_deg: 2.0, ..general };
        match self {
            Self::General(_) => general,
            Self::Centered1 => {
                Placement { near_mm: 350.0, far_mm: 1400.0, region: [0.44, 0.44, 0.56, 0.56], ..general }
            }
            Self::Longplywood1 | Self::Longplywood2 => {
                Placement { near_mm: 500.0, far_mm: 1500.0, max_tilt_deg: 40.0, ..general }
            }
            Self::Plywood1 => Placement { near_mm: 350.0, far_mm: 900.0, max_tilt_deg: 40.0, ..general },
            Self::Sameheight1 => parallel(990.0, 1010.0),
            Self::Sameheight2 => parallel(485.0, 515.0),
            Self::Filling1 => Placement {
                near_mm: 190.0,
                far_mm: 300.0,
                max_tilt_deg: 35.0,
                max_roll_deg: 10.0,
                region: [0.4, 0.4, 0.6, 0.6],
            },
            Self::Vertical1 => Placement { near_mm: 350.0, far_mm: 1200.0, region: [0.0, 0.0, 0.45, 1.0], ..general },
        }
    }
}

/// Limits of the board's poses.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placement {
    /// Nearest distance of the board's middle, mm.
    pub near_mm: f64,
    /// Farthest distance, mm.
    pub far_mm: f64,
    /// Largest angle between the board and the image plane, degrees.
    pub max_tilt_deg: f64,
    /// Largest rotation in the board's plane, degrees.
    pub max_roll_deg: f64,
    /// Region of the board's middle, [u0, v0, u1, v1] in fractions of the image's size.
    pub region: [f64; 4],
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::General(number) => return write!(f, "general{number}"),
            Self::Centered1 => "centered1",
            Self::Longplywood1 => "longplywood1",
            Self::Longplywood2 => "longplywood2",
            Self::Plywood1 => "plywood1",
            Self::Sameheight1 => "sameheight1",
            Self::Sameheight2 => "sameheight2",
            Self::Vertical1 => "vertical1",
            Self::Filling1 => "filling1",
        };
        f.write_str(name)
    }
}

impl FromStr for Kind {
    type Err = SimulateError;

    /// Parses a kind's name. `general` is `general1`; `generalN` is another capture of that kind.
    fn from_str(name: &str) -> Result<Self, SimulateError> {
        if let Some(number) = name.strip_prefix("general") {
            if number.is_empty() {
                return Ok(Self::General(1));
            }
            if let Ok(number) = number.parse() {
                return Ok(Self::General(number));
            }
        }
        let known = || Self::ALL.into_iter().chain([Self::Filling1]);
        known().find(|kind| kind.to_string() == name).ok_or_else(|| SimulateError::UnknownKind {
            name: name.to_owned(),
            known: known().map(|kind| kind.to_string()).collect::<Vec<_>>().join(", ") + ", general2, general3, …",
        })
    }
}

impl From<Kind> for String {
    fn from(kind: Kind) -> Self {
        kind.to_string()
    }
}

impl TryFrom<String> for Kind {
    type Error = SimulateError;

    fn try_from(name: String) -> Result<Self, SimulateError> {
        name.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for kind in Kind::ALL.into_iter().chain([Kind::General(7), Kind::Filling1]) {
            assert_eq!(kind.to_string().parse::<Kind>().unwrap(), kind);
        }
        assert_eq!("general".parse::<Kind>().unwrap(), Kind::General(1));
        let error = "diagonal1".parse::<Kind>().unwrap_err().to_string();
        assert!(error.contains("diagonal1") && error.contains("sameheight2"), "{error}");
    }
}
