//! The tests of the crate, one module per subject: `cargo test -p depthcal-solver --test suite bounds` runs those of one module.

mod bounds;
mod checkpoint;
mod choice;
mod common;
mod covariance;
mod ill_conditioned;
mod lanes;
mod linear_solvers;
mod properties;
mod score;
mod score_dense;
mod sessions;
mod solve;
mod threads;
