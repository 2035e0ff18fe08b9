//! The search for the cause, where declarations and data contradict each other: cheap alternatives to what a dataset declares are
//! tried on its data, and the one that fits clearly better than the declaration and than all others is named.
//!
//! | data | alternatives | evidence |
//! |---|---|---|
//! | depth ([`DepthAlternative`]) | how its image lies on the image, its quantity, its frame | the boards that the images show |
//! | depth ([`Registration`]) | depth on a pixel grid of its own | as above |
//! | boards (`board`) | mirrored images; kind, size, dictionary, first tag, side of tags | tags of any dictionary, lattices |
//!
//! A wrong cause is worse than none: where two fit alike, none is named.

#[cfg(feature = "detect")]
mod board;
#[cfg(feature = "detect")]
mod board_alternative;
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
pub use board::{TRIED, board_cause, board_cause_of_few_markers};
#[cfg(feature = "detect")]
pub use board_fault::{BoardCause, BoardFault};
pub use depth_alternative::{DepthAlternative, Quantity, Turn};
pub use depth_cause::DepthCause;
pub use depth_points::Deviation;
pub use depth_search::{DepthFinding, examine_depth};
pub use registration::Registration;
