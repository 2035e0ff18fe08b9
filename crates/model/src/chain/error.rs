//! Why a chain has no value.

use thiserror::Error;

/// Reason why a chain has no value.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ChainError {
    /// A board point lies behind the camera.
    #[error("board point ({x:.1}, {y:.1}) mm lies behind the camera (z = {z:.3} mm)")]
    BehindCamera {
        /// Board x, mm.
        x: f64,
        /// Board y, mm.
        y: f64,
        /// Its z in the camera frame, mm.
        z: f64,
    },
    /// The ray of a depth pixel does not meet the board within the chain's domain.
    #[error("the ray of depth pixel ({u:.2}, {v:.2}) does not meet the board")]
    NoIntersection {
        /// Column, px.
        u: f64,
        /// Row, px.
        v: f64,
    },
}
