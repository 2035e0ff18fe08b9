//! Tests of what a problem's model lacks, from one linearisation and without solving again.
//!
//! Variables that a graph holds at their values are restrictions: the model says that they are there and have no effect.
//! At the optimum of the rest, the gradient by a held variable tells whether the data pull at it. That is the score test
//! (Rao 1948; Lagrange multiplier test, Silvey 1959), and the step that the variable would make is its expected change
//! (Saris, Satorra, Sörbom 1987). With J the Jacobian of everything free, G that of a candidate and r the residuals,
//!
//! ```text
//! G⊥ = G − J (JᵀJ)⁻¹ JᵀG,   S = rᵀG⊥ (G⊥ᵀG⊥)⁺ G⊥ᵀr,   expected change −(G⊥ᵀG⊥)⁺ G⊥ᵀr.
//! ```
//!
//! Residuals that are not independent make every S large. Therefore residuals belong to clusters (the frames of a
//! capture, the runs of an experiment), and everything is kept cluster by cluster:
//!
//! - [`Linearization`]: normal equations of every cluster, with the variables of one cluster alone (its pose) eliminated;
//! - [`Score`]: the test, with p-values from the model's noise and from the scatter between clusters (White 1982,
//!   Liang, Zeger 1986);
//! - [`Linearization::held_out_gain`]: what a candidate, estimated without a cluster, takes off that cluster's cost;
//! - [`Linearization::detectable_factor`] and [`Linearization::visible_information`]: the smallest effect that these
//!   data show;
//! - [`Linearization::mimicry`]: how well one candidate can play another.

mod distribution;
mod held_out;
mod linearization;
mod projection;
mod test;

pub use distribution::{chi_squared_tail, f_tail, noncentral_chi_squared_tail, noncentrality};
pub use linearization::{Candidate, Linearization, ScoreError};
pub use test::Score;
