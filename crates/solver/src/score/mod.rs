//! Score tests for effects missing from a model, from one linearisation and without solving again.
//!
//! An effect that may be missing is a *candidate*: variables that are part of the graph but fixed at values at which they
//! have no effect. At the minimum over the free variables, the gradient with respect to the fixed ones shows whether the
//! data contradict these values. That is the score test (Rao 1948; Lagrange multiplier test, Silvey 1959). The
//! Gauss–Newton step that the candidate would make if it were free is its expected change (Saris, Satorra, Sörbom 1987).
//! With J the Jacobian of the free variables, G that of the candidate and r the residuals,
//!
//! ```text
//! G⊥ = G − J (JᵀJ)⁻¹ JᵀG,   S = rᵀG⊥ (G⊥ᵀG⊥)⁺ G⊥ᵀr,   expected change −(G⊥ᵀG⊥)⁺ G⊥ᵀr.
//! ```
//!
//! where ⁺ is the pseudo-inverse. Correlated residuals make every S large. Residuals are therefore grouped into clusters
//! that are independent of each other (the frames of a capture, the runs of an experiment), and normal equations are kept
//! per cluster:
//!
//! - [`Linearization`]: normal equations of every cluster, with the variables of that cluster alone (such as its pose)
//!   eliminated;
//! - [`Score`]: the test, with p-values from the noise model and from the scatter between clusters (White 1982;
//!   Liang, Zeger 1986);
//! - [`Linearization::held_out_gain`]: by how much a candidate, estimated without a cluster, decreases that cluster's cost;
//! - [`Linearization::detectable_factors`] and [`Linearization::visible_information`]: the smallest effect that these data
//!   can reveal;
//! - [`EfficientScores`]: scores and information of several candidates together, which add up over independent data sets;
//! - [`Linearization::mimicry`]: how well one candidate can reproduce the effect of another.

mod efficient;
mod held_out;
mod linearization;
mod pseudo_inverse;
mod score_test;
pub(crate) mod structure;

pub use efficient::EfficientScores;
pub use linearization::Linearization;
pub use score_test::Score;
pub use structure::{Candidate, ScoreError};
