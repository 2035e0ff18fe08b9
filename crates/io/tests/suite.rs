//! The tests of the crate, one module per subject: `cargo test -p depthcal-io --test suite formats` runs those of one module.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "tests say what they measured")]

mod formats;
mod measured_data;
mod owners;
mod schemas;

#[path = "../../../tests/support/python.rs"]
mod python;
