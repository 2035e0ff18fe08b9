//! The statistics of depthcal, each in one place: tails of distributions, quantiles, moments, ranks, spans of linear models, and
//! bootstraps over frames.
//!
//! Distributions come from `statrs`. Quantiles are linearly interpolated (type 7 of Hyndman and Fan 1996)
//! but where one of the values themselves is wanted.

mod bootstrap;
mod moments;
mod quantiles;
mod ranks;
mod shared_structure;
mod span;
mod tails;
mod thinning;

pub use bootstrap::{Bootstrap, Estimate};
pub use moments::{mean_std, mean_to_standard_error, rms};
pub use quantiles::{median, nearest_rank, quantile, quantile_of_sorted, upper_median};
pub use ranks::rank_correlation;
pub use shared_structure::{PlacedValue, SharedOctave, family_p_values, shared_structure};
pub use span::Span;
pub use tails::{
    chi_squared_tail, chi_squared_upper_quantile, f_tail, gamma_tail, noncentral_chi_squared_tail, noncentrality,
    normal_tail, student_quantile, weighted_chi_squared_tail,
};
pub use thinning::Thinning;
