//! Errors of a fitted camera: on a capture, and on frames that its fit did not see.

pub mod camera;
pub mod capture_cross_validation;
mod corrected_pixels;
pub mod cross_validation;
pub mod depth_errors;
pub mod difference;
pub mod evaluate;
mod evaluation_record;
pub mod intervals;
mod linearity;
pub mod parts;
pub mod table;
pub mod transfer;
pub mod whole_frames;
