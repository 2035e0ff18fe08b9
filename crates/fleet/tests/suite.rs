//! The tests of the crate, one module per subject: `cargo test -p depthcal-fleet --test suite outliers` runs those of one module.

mod outliers;
mod random_effects;
