//! A depth effect that the caller gives as a function.

use std::fmt;
use std::sync::Arc;

use super::place::{Form, Place};
use crate::instrument::{DepthEffect, Reading, Stage, with_depth_added};

/// The error-free measurement of a depth pixel, as a [`GivenEffect`] sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The pixel of the depth image (u, v), px.
    pub pixel: [f64; 2],
    /// Its ray (x, y, 1).
    pub ray: [f64; 2],
    /// Depth that the effect acts on, mm.
    pub depth_mm: f64,
    /// Cosine of the angle of incidence.
    pub cosine: f64,
    /// Infrared signal at the pixel, share of the image's full scale.
    pub amplitude: f64,
    /// Time since the first frame, s.
    pub time_s: f64,
    /// Temperature of the camera, °C.
    pub temperature_c: f64,
}

type Function = Arc<dyn Fn(&Observation) -> f64 + Send + Sync>;

/// A depth effect given as a function: what it adds to depth (mm), to inverse depth (1/mm) or to the factor of depth.
#[derive(Clone)]
pub struct GivenEffect {
    /// Its name in the truth of the simulation.
    pub name: String,
    /// The state that it depends on.
    pub place: Place,
    /// The quantity that its value is added to.
    pub form: Form,
    /// Its value.
    pub function: Function,
}

impl fmt::Debug for GivenEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "GivenEffect({}, {:?}, {:?})", self.name, self.place, self.form)
    }
}

impl DepthEffect for GivenEffect {
    fn stage(&self) -> Stage {
        match self.place {
            Place::True => Stage::Signal,
            Place::Measured => Stage::Output,
        }
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let Reading { pixel, ray, cosine, amplitude, conditions } = *reading;
        let (time_s, temperature_c) = (conditions.time_s, conditions.temperature_c);
        let depth_mm = 1.0 / rho;
        let value = (self.function)(&Observation { pixel, ray, depth_mm, cosine, amplitude, time_s, temperature_c });
        match self.form {
            Form::Depth => with_depth_added(rho, value),
            Form::Factor => rho / (1.0 + value),
            Form::InverseDepth => rho + value,
        }
    }
}
