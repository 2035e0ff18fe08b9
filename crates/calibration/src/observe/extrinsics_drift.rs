//! Places of cameras that change with time or temperature.

use crate::observe::RawFrame;
use depthcal_io::DriftOver;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// When something was taken, and at which temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taken {
    /// Time, s.
    pub time_s: f64,
    /// Temperature, °C; NaN where unknown.
    pub temperature_c: f64,
}

impl Taken {
    /// Of a frame. Times of several cameras have one origin where the dataset gives them.
    pub fn of(frame: &RawFrame) -> Self {
        Self {
            time_s: frame.metadata.timestamp_s.unwrap_or(frame.time_s),
            temperature_c: frame.metadata.temperature_c.unwrap_or(frame.temperature_c),
        }
    }
}

/// A place (R, t) that changes in proportion to time or temperature: (R Exp(s ω), t + s τ) with s = (x − `reference`) / `range`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceDrift {
    /// x.
    pub over: DriftOver,
    /// Value of x at which the camera has its place: the mean over the frames.
    pub reference: f64,
    /// Range of x over which the place changes by `change`: that of the frames.
    pub range: f64,
    /// ω (rad, about the axes of the rig) and τ (mm, along those of the camera).
    pub change: [f64; 6],
}

impl PlaceDrift {
    /// Value of what a drift depends on.
    pub fn value(over: DriftOver, taken: &Taken) -> f64 {
        match over {
            DriftOver::Time => taken.time_s,
            DriftOver::Temperature => taken.temperature_c,
        }
    }

    /// s of what was taken so; 0 where its time or temperature is unknown.
    pub fn share(&self, taken: &Taken) -> f64 {
        let share = (Self::value(self.over, taken) - self.reference) / self.range;
        if share.is_finite() { share } else { 0.0 }
    }

    /// The place of a camera, whose own is `camera_from_rig`, for what was taken so.
    pub fn place(&self, camera_from_rig: &Isometry3<f64>, taken: &Taken) -> Isometry3<f64> {
        drifted(camera_from_rig, &self.change, self.share(taken))
    }
}

/// A place (R, t) after the share `s` of a drift (ω, τ): (R Exp(s ω), t + s τ).
pub(crate) fn drifted(place: &Isometry3<f64>, change: &[f64], s: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(change[0], change[1], change[2]) * s);
    let shift = Vector3::new(change[3], change[4], change[5]) * s;
    Isometry3::from_parts((place.translation.vector + shift).into(), place.rotation * turn)
}
