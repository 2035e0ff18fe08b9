//! Calibrations beside OpenCV's, one module per function of OpenCV.

mod single;
mod stereo;

#[path = "../../../tests/support/measured.rs"]
mod measured;
