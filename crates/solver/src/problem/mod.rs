//! The problem as the user states it: variables and their values, factors in batches, losses, noise, priors, bounds.
//!
//! Nothing here depends on how the problem is solved.

pub(crate) mod autodiff;
pub(crate) mod batch;
pub(crate) mod error;
pub(crate) mod euclidean;
pub(crate) mod factor;
pub(crate) mod factor_batch;
pub(crate) mod graph;
pub(crate) mod group_subset;
pub(crate) mod jacobian_check;
pub(crate) mod key;
pub(crate) mod labels;
pub(crate) mod lane;
pub(crate) mod loss;
pub(crate) mod manifold;
pub(crate) mod noise;
pub(crate) mod prior;
pub(crate) mod rigid_motion;
pub(crate) mod unrolled;
pub(crate) mod values;
pub(crate) mod variable;
