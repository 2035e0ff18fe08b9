//! Pieces whose parameters are fields over the image, and over depth where they need it.
//!
//! A correction that differs from pixel to pixel is written as a depth [`Piece`](crate::Piece) with the few parameters
//! that it has *at* a pixel, and wrapped into a [`Field`]: each of these local parameters is interpolated between the nodes
//! of a [`Grid`], and the values at the nodes are fitted. A derivative by a node is the derivative by the local parameter
//! times the weight of the node, so that the dual numbers stay as narrow as the local piece.

mod interpolated;

pub use crate::grid::{Domain, FieldLayout, Grid, Interpolation};
pub use interpolated::Field;
