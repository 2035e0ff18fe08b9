//! Calibrations beside OpenCV's, one module per function of OpenCV.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "tests say what they measured")]

mod single;
mod stereo;

#[path = "../../../tests/support/measured.rs"]
mod measured;
