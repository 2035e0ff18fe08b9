//! The tests of the crate, one module per subject: `cargo test -p depthcal-simulate --test suite defects` runs those of one
//! module.

mod defects;
mod plant;
mod points;
mod render;
