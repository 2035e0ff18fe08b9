//! The place and the form of a depth effect: a catalogued shape that acts elsewhere than where the catalogue has it.

use serde::{Deserialize, Serialize};

use crate::instrument::{DepthEffect, Reading, Stage, with_depth_added};

/// The state that a depth effect depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The true depth.
    True,
    /// The camera's output, behind the projective distortion.
    Measured,
}

/// The quantity that a depth effect is added to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Depth: the same millimetres at every distance.
    Depth,
    /// The factor of depth: millimetres that grow with the distance.
    Factor,
    /// Inverse depth: millimetres that grow with its square.
    InverseDepth,
}

impl Place {
    /// Both places.
    pub const ALL: [Self; 2] = [Self::True, Self::Measured];

    /// Its name in `@of=`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::Measured => "measured",
        }
    }
}

impl Form {
    /// All forms.
    pub const ALL: [Self; 3] = [Self::Depth, Self::Factor, Self::InverseDepth];

    /// Its name in `@on=`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Factor => "factor",
            Self::InverseDepth => "inverse_depth",
        }
    }

    /// The power of depth with which the millimetres grow.
    fn power(self) -> i32 {
        match self {
            Self::Depth => 0,
            Self::Factor => 1,
            Self::InverseDepth => 2,
        }
    }
}

/// A depth effect in another place and form. Its millimetres at 1 m are those of the effect itself.
pub(super) struct Placed {
    pub effect: Box<dyn DepthEffect>,
    /// The form that the effect has by itself.
    pub own: Form,
    pub place: Place,
    pub form: Form,
}

impl DepthEffect for Placed {
    fn stage(&self) -> Stage {
        match self.place {
            Place::True => Stage::Signal,
            Place::Measured => Stage::Output,
        }
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let added = 1.0 / self.effect.distort(reading, rho) - 1.0 / rho;
        with_depth_added(rho, added * (1e-3 / rho).powi(self.form.power() - self.own.power()))
    }
}
