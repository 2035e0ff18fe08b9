//! The tests of the crate, one module per subject: `cargo test -p depthcal-solver --test suite bounds` runs those of one module.

mod additive;
mod benchmark_formats;
mod bounds;
mod checkpoint;
mod choice;
mod common;
mod covariance;
mod ill_conditioned;
mod incremental;
mod lanes;
mod linear_solvers;
mod pose_graph_optima;
mod pose_graphs;
mod properties;
mod score;
mod score_dense;
mod sessions;
mod solve;
mod threads;

// What the examples share, and tests here read with.
#[path = "../examples/support/bal.rs"]
mod bal;
#[path = "../examples/support/g2o.rs"]
mod g2o;
#[path = "../../../tests/support/measured.rs"]
mod measured;
#[path = "../examples/support/pose_factors.rs"]
mod pose_factors;
#[path = "../examples/support/street.rs"]
mod street;
#[path = "../examples/support/synthetic.rs"]
mod synthetic;
#[path = "../examples/support/words.rs"]
mod words;
