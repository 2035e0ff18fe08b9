//! The pose of the board in a frame: X = R Exp(ω) P + t + τ with the tangent (ω, τ). It is a variable of the frame, not of the
//! camera.

use crate::piece::Parameter;

/// Dimension of the tangent (ω, τ), rad and mm.
pub const POSE: usize = 6;
/// Name in reports.
pub const NAME: &str = "pose";
/// Summary in plain words that follow its name and a colon.
pub const SUMMARY: &str = "rotation and position of the board in the camera's frame";

/// Its tangent at a given pose.
pub static PARAMETERS: [Parameter; POSE] = [
    Parameter::new("omega_x", "rad", 0.0, 1e-3).meaning("Rotation about the x axis of the board."),
    Parameter::new("omega_y", "rad", 0.0, 1e-3).meaning("Rotation about the y axis of the board."),
    Parameter::new("omega_z", "rad", 0.0, 1e-3).meaning("Rotation about the z axis of the board."),
    Parameter::new("tau_x", "mm", 0.0, 1.0).meaning("Position of the board along the x axis of the camera."),
    Parameter::new("tau_y", "mm", 0.0, 1.0).meaning("Position of the board along the y axis of the camera."),
    Parameter::new("tau_z", "mm", 0.0, 1.0).meaning("Position of the board along the z axis of the camera."),
];
