//! The state of a solver between two iterations.

use std::path::PathBuf;

use crate::checkpoint::CheckpointError;
use crate::options::Options;
use crate::report::{Iteration, StageSeconds, Termination};

/// Costs that differ by more than this, relatively, are those of different problems: evaluations with and without
/// derivatives may differ in rounding.
const SAME_COST: f64 = 1e-6;

/// What it takes to go on with the same bits: what is not here follows from the values.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    /// See [`setup`].
    pub setup: Vec<(String, String)>,
    pub rows: usize,
    pub mu: f64,
    pub nu: f64,
    pub radius: f64,
    pub d2: Vec<f64>,
    /// If the values are those of the last linearisation.
    pub first_prediction: Option<f64>,
    pub cost0: f64,
    pub cost: f64,
    pub gradient: f64,
    pub trace: Vec<Iteration>,
    pub seconds: StageSeconds,
    pub termination: Option<Termination>,
}

/// The options that determine the steps, in words. Limits and tolerances may differ between a run and its continuation.
pub(crate) fn setup(options: &Options) -> Vec<(String, String)> {
    let text = |name: &str, value: &dyn std::fmt::Debug| (name.to_owned(), format!("{value:?}"));
    vec![
        text("method", &options.method),
        text("damping", &options.damping),
        text("scaling", &options.scaling),
        text("linear_solver", &options.linear_solver),
        text("min_gain_ratio", &options.min_gain_ratio),
    ]
}

/// What a solver made from a checkpoint checks once it sees the problem.
#[derive(Clone, Debug)]
pub(crate) struct Resumed {
    pub path: PathBuf,
    pub rows: usize,
    pub cost: f64,
    pub first_prediction: Option<f64>,
}

impl Resumed {
    fn foreign(&self, reason: String) -> CheckpointError {
        CheckpointError::Foreign { path: self.path.clone(), reason }
    }

    /// Whether the problem has the size of that of the checkpoint.
    pub fn check_layout(&self, rows: usize, unknowns: usize, stored: usize) -> Result<(), CheckpointError> {
        if (rows, unknowns) == (self.rows, stored) {
            return Ok(());
        }
        let of = self.rows;
        Err(self.foreign(format!(
            "it has {of} residuals and {stored} unknowns, this problem {rows} residuals and {unknowns} unknowns"
        )))
    }

    /// Whether the problem has the cost that the checkpoint says.
    pub fn check_cost(&self, cost: f64) -> Result<(), CheckpointError> {
        if (cost - self.cost).abs() <= SAME_COST * self.cost.abs() + f64::MIN_POSITIVE {
            return Ok(());
        }
        Err(self.foreign(format!("the cost at its values is {:e}, that of this problem {cost:e}", self.cost)))
    }
}
