//! Errors of a fitted camera: on a capture, and on frames that its fit did not see.

pub mod cross_validation;
pub mod depth_errors;
pub mod difference;
pub mod evaluate;
mod linearity;
pub mod parts;
pub mod rig;
pub mod rig_cross_validation;
pub mod table;
pub mod transfer;
