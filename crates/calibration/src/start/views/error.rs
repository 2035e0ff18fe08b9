//! Errors of the cameras' relative poses.

use thiserror::Error;

/// Why the extrinsics of a rig cannot be determined from shared views.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ExtrinsicsError {
    /// No chain of shared views leads from the reference to a camera.
    #[error(
        "camera {camera} shares too few views with the others ({shared}): it needs at least {needed} frames in which it and a camera \
         that is connected to {reference} see the board; check that frames of the cameras are paired ([frames] within_s, or a table)"
    )]
    Unconnected {
        /// The camera.
        camera: String,
        /// The reference.
        reference: String,
        /// Shared views of the best pair.
        shared: usize,
        /// Views that are needed.
        needed: usize,
    },
    /// The cameras have moved against each other.
    #[error(
        "{camera} has moved against {other}: {first} frames ({first_frames}) fit one place, {second} frames ({second_frames}) another, \
         {angle_deg:.2}° and {distance_mm:.1} mm away: calibrate these frames apart, and fasten the cameras"
    )]
    Moved {
        /// The camera.
        camera: String,
        /// The camera that it is seen with.
        other: String,
        /// Number of frames that fit the first place.
        first: usize,
        /// Their names, some of them.
        first_frames: Box<str>,
        /// Number of frames that fit the second place.
        second: usize,
        /// Their names, some of them.
        second_frames: Box<str>,
        /// Angle between the places, degrees.
        angle_deg: f64,
        /// Distance between the places, mm.
        distance_mm: f64,
    },
}
