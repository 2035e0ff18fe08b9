//! The tests of the crate, one module per subject: `cargo test -p depthcal-detect --test suite batch` runs those of one module.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "tests say what they measured")]

mod batch;
mod bias;
mod built_in;
mod chessboards;
mod circle_grids;
mod common;
mod dictionaries;
mod fiducials;
mod lens_oracles;
mod measured;
mod several_boards;
