//! Shared views: relative poses of pairs of cameras, the graph that connects all cameras, and frames that contradict.

mod average;
mod graph;
mod pair;

pub use graph::{Node, PairSummary, Places, connect};
pub use pair::{Contradiction, PairView, RelativePose, relative_pose};
