//! The iteration: steps of Levenberg–Marquardt, dog-leg or Gauss–Newton, their damping, when to stop, what is reported, and
//! how a run is continued from a checkpoint or after a change of the problem.

pub(crate) mod argmin_solver;
pub(crate) mod checkpoint;
pub(crate) mod checkpoint_error;
pub(crate) mod damping;
pub(crate) mod dog_leg;
pub(crate) mod error;
pub(crate) mod exact;
pub(crate) mod interrupt;
pub(crate) mod iteration;
pub(crate) mod levenberg_marquardt;
pub(crate) mod minimize;
pub(crate) mod options;
pub(crate) mod report;
pub(crate) mod resume;
pub(crate) mod session;
pub(crate) mod snapshot;
pub(crate) mod solution;
pub(crate) mod values_pool;
