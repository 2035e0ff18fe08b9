//! The chain of pieces from a board point to a pixel and to a measured inverse depth, with all its derivatives.
//!
//! Every piece is linearised on its own; the rows of the full Jacobian are made backwards, from the pixel (or the
//! measured depth) to the board, so that only 1 × k times k × k products occur. Columns of a row:
//!
//! ```text
//! pose (ω, τ) | board pieces | lens pieces | pinhole fx fy cx cy s | pixel pieces | depth pieces
//! ```
//!
//! The pose's tangent is that of X = R Exp(ω) P' + t + τ. A depth pixel is fixed and the point of the board that it
//! sees is not: that point is found by Newton's method on the forward chain, and its derivative follows from the
//! implicit function theorem, so that every piece (a bent board, a focal length that depends on distance) is treated
//! alike.

mod batch;
mod error;
mod forward;
mod pieces;
mod predict;
mod reverse;

pub use crate::pinhole::PINHOLE;
pub use crate::pose::POSE;

pub use batch::Workspace;
pub use error::ChainError;
pub use pieces::Chain;
pub use predict::DepthQuery;
