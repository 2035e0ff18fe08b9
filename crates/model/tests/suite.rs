//! The tests of the crate, one module per subject: `cargo test -p depthcal-model --test suite camera` runs those of one module.

mod camera;
mod descriptions;
mod fields;
mod frame_covariates;
mod jacobians;
