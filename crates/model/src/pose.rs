//! The pose of the board in a frame: X = R Exp(ω) P + t + τ with the tangent (ω, τ). It is a variable of the frame, not of the
//! camera.

/// Dimension of the tangent (ω, τ), rad and mm.
pub const POSE: usize = 6;
