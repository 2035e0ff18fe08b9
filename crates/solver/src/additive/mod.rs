//! Additive model of residuals: which smooth functions of known quantities is a model missing, several at once?
//!
//! Two missing effects can hide each other where each is tested alone: neither lowers the error of left-out clusters for certain
//! while the other one is there. So all pairs of functions are compared, by algebra on one matrix of products per block of
//! clusters; members are exchanged against all others; and each is tested against chance given all others ([`search()`]).
//! How smooth they are is chosen on left-out clusters ([`Strengths`]).
//!
//! [`missing_functions`] does all of it for a factor graph, with a library of functions of one covariate, alone or times another,
//! and of two. [`Additive`] is the model itself, for libraries of one's own.
//!
//! The model: Hastie, Tibshirani, *Generalized Additive Models* (1990); its smooth functions: Eilers, Marx, *Flexible smoothing
//! with B-splines and penalties*, Statistical Science 11 (1996); the test: Wilcoxon, *Individual comparisons by ranking methods*,
//! Biometrics 1 (1945).

mod axis;
mod blocks;
mod candidate_products;
mod functions;
mod model;
mod normal;
mod penalty;
mod products;
mod rows;
mod search;
mod strengths;
mod widened;

pub use axis::{Axis, CUBIC, LINEAR, SUPPORT, smoothness_precision};
pub use functions::{Covariate, MissingFunction, Observed, missing_functions};
pub use model::{Additive, Cluster, Group, Table};
pub use normal::Normal;
pub use penalty::Precision;
pub use rows::ClusterRows;
pub use search::{Found, certain, grown, search};
pub use strengths::Strengths;
pub use widened::widened;
