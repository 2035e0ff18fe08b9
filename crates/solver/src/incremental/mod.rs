//! Problems that grow frame by frame: what frames share is kept as a small system onto which each frame is reduced.

mod error;
mod frame;
mod options;
mod session;

pub use error::IncrementalError;
pub use options::IncrementalOptions;
pub use session::{FrameId, IncrementalSession};
