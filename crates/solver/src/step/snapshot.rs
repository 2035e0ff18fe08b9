//! The state of a solver between two iterations.

use std::path::PathBuf;

use crate::step::checkpoint_error::CheckpointError;
use crate::step::options::Options;
use crate::step::report::{Iteration, StageSeconds, Termination};

/// Relative difference of costs above which they belong to different problems. Below, evaluations with and without
/// derivatives may differ by rounding errors.
const SAME_COST: f64 = 1e-6;

/// The state of a solver that, together with the values, continues the run bit by bit.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    /// The options that determine the steps: see [`step_options`].
    pub step_options: Vec<(String, String)>,
    /// Number of scalar residuals.
    pub rows: usize,
    pub mu: f64,
    pub nu: f64,
    pub radius: f64,
    pub d2: Vec<f64>,
    /// The first predicted decrease since the last linearisation, if that was at the values of the snapshot.
    pub first_prediction: Option<f64>,
    pub cost0: f64,
    pub cost: f64,
    pub gradient: f64,
    pub trace: Vec<Iteration>,
    pub seconds: StageSeconds,
    pub termination: Option<Termination>,
}

/// Names and values, as text, of the options that determine the steps. Limits and tolerances, which are not among them, may
/// differ between a run and its continuation.
pub(crate) fn step_options(options: &Options) -> Vec<(String, String)> {
    let text = |name: &str, value: &dyn std::fmt::Debug| (name.to_owned(), format!("{value:?}"));
    vec![
        text("method", &options.method),
        text("damping", &options.damping),
        text("scaling", &options.scaling),
        text("linear_solver", &options.linear_solver),
        text("min_gain_ratio", &options.min_gain_ratio),
    ]
}

/// Data of a checkpoint that a resumed solver checks against its problem.
#[derive(Clone, Debug)]
pub(crate) struct ResumeCheck {
    pub path: PathBuf,
    pub rows: usize,
    pub cost: f64,
    pub first_prediction: Option<f64>,
}

impl ResumeCheck {
    /// The error for a checkpoint of another problem.
    fn foreign(&self, reason: String) -> CheckpointError {
        CheckpointError::Foreign { path: self.path.clone(), reason }
    }

    /// Checks that the problem has as many residuals and unknowns as that of the checkpoint, which had `stored` unknowns.
    pub fn check_layout(&self, rows: usize, unknowns: usize, stored: usize) -> Result<(), CheckpointError> {
        if (rows, unknowns) == (self.rows, stored) {
            return Ok(());
        }
        let residuals = self.rows;
        Err(self.foreign(format!(
            "it has {residuals} residuals and {stored} unknowns, this problem has {rows} residuals and {unknowns} unknowns"
        )))
    }

    /// Checks that the problem has the cost of the checkpoint.
    pub fn check_cost(&self, cost: f64) -> Result<(), CheckpointError> {
        if (cost - self.cost).abs() <= SAME_COST * self.cost.abs() + f64::MIN_POSITIVE {
            return Ok(());
        }
        Err(self.foreign(format!("its cost is {:e}, that of this problem at the same values is {cost:e}", self.cost)))
    }
}
