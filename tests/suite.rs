//! The tests of the whole program, one module per subject. One test program for all of them is linked once, and its tests run
//! side by side: `cargo test --test suite crash_safety` runs those of one module.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "tests say what they measured")]

mod apply_runs;
mod apply_streams;
mod bad_input;
mod circle_diameter;
mod commands;
mod compare;
mod crash_safety;
mod diagnose;
mod diff;
mod discovered;
mod documented_toml;
mod effects;
mod estimators;
mod fields;
mod first_screen;
mod fisheye;
mod fleet;
mod formulas;
mod hard_captures;
mod invariances;
mod json;
mod measured;
mod other_formats;
mod own_model;
mod quantities;
#[cfg(feature = "import")]
mod recordings;
mod rendered;
mod repeatable;
mod rig_traced;
mod rigs;
mod start_values;
mod stray_light;
mod support;
mod thresholds_documented;
mod uncertainty;
mod unwritable;
