//! The search for the cause, where declarations and data contradict each other: cheap alternatives to what a dataset declares are
//! tried on its data, and the one that fits clearly better than the declaration and than all others is named.
//!
//! | data | alternatives | evidence |
//! |---|---|---|
//! | depth ([`depth_alternative`]) | how its image lies on the image, the quantity that it holds, the frame to which it belongs | the boards that the images show |
//! | depth ([`registration`]) | depth on a pixel grid of its own | as above |
//! | boards ([`board`]) | mirrored images; kind, columns and rows, dictionary, first tag, side of the tags | tags of any dictionary, lattices of any size |
//!
//! A wrong cause is worse than none: where two fit alike, none is named.

#[cfg(feature = "detect")]
pub(crate) mod board;
#[cfg(feature = "detect")]
mod board_fault;
mod depth_alternative;
mod depth_cause;
mod depth_points;
mod depth_search;
mod registration;
#[cfg(feature = "detect")]
mod tag_board;

#[cfg(feature = "detect")]
pub use board_fault::{BoardCause, BoardFault};
pub use depth_alternative::{DepthAlternative, Quantity, Turn};
pub use depth_cause::DepthCause;
pub use depth_points::Deviation;
pub(crate) use depth_search::{DepthFinding, examine_depth};
pub use registration::Registration;
