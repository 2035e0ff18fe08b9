//! Shared views: relative poses of pairs of cameras, the graph that connects all cameras, and frames that contradict.

mod average;
mod error;
mod graph;
mod labels;
mod offset;
mod pair;

pub use error::ExtrinsicsError;
pub use graph::{Node, PairSummary, Places, connect, offset_between};
pub(crate) use labels::numbered_for;
pub use labels::{BoardTurn, turns};
pub use offset::{MovingView, OffsetEstimate, time_offset};
pub use pair::{Contradiction, PairView, RelativePose, relative_pose};
