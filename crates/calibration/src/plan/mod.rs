//! Which captures to add: poses of the board that lower an uncertainty most, and how many frames like these are enough.
//!
//! What a fit knows is the inverse of its parameters' covariance; what a frame would add is its information on them, with the
//! pose of the board eliminated, at the fitted values: it does not depend on what the frame will measure. A goal is the mean
//! square of linear functions of the parameters; the pose that lowers it most is taken, and the search goes on with it (greedy
//! V-optimal design, after Rojtberg, Kuijper: Efficient Pose Selection for Interactive Camera Calibration, ISMAR 2018).

mod error;
mod goal;
mod planner;
#[cfg(test)]
mod planner_tests;
mod pose;
mod predicted;
mod selection;
#[cfg(test)]
mod selection_tests;
mod view;

pub use goal::{Goal, GoalError};
pub use planner::{Plan, PlanError, Planned, Planner};
pub use pose::{BoardTilt, ImagePlace, ProposedFrame};
pub use predicted::{pose_showing, predicted_frame};
pub use selection::{ChosenFrames, HeldOutViews, SelectedFrame, Selection, hold_out_views};
pub use view::BoardView;
