//! Errors of a rig on a capture: of every camera, and from one camera to another.

mod evaluate;
mod transfer;

pub use evaluate::{EvaluatedRig, evaluate_rig};
pub use transfer::{Transfer, TransferPoint};
