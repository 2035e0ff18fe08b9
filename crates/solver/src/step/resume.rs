//! Snapshots of a solver, continuing from one, and the reason why a run ended.

use std::path::PathBuf;

use argmin::core::TerminationReason;

use crate::step::damping::StepControl;
use crate::step::levenberg_marquardt::LevenbergMarquardt;
use crate::step::options::Options;
use crate::step::report::Termination;
use crate::step::snapshot::{ResumeCheck, Snapshot, step_options};

impl LevenbergMarquardt {
    /// The state from which the run can be continued.
    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot {
            step_options: step_options(&self.options),
            rows: self.system.as_ref().map_or(0, |s| s.layout.rows),
            mu: self.control.mu,
            nu: self.control.nu,
            radius: self.control.radius,
            d2: self.d2.clone(),
            first_prediction: self.first_prediction.filter(|_| self.linearized),
            cost0: self.cost0,
            cost: self.cost,
            gradient: self.gradient,
            trace: self.trace.clone(),
            seconds: self.seconds,
            termination: self.termination.clone(),
        }
    }

    /// A solver that continues from a snapshot, which was read from the checkpoint at `path`.
    pub(crate) fn resume(options: Options, snapshot: Snapshot, path: PathBuf) -> Self {
        let (rows, cost, first_prediction) = (snapshot.rows, snapshot.cost, snapshot.first_prediction);
        let mut control = StepControl::new(options.method, options.damping);
        (control.mu, control.nu, control.radius) = (snapshot.mu, snapshot.nu, snapshot.radius);
        Self {
            resume_check: Some(ResumeCheck { path, rows, cost, first_prediction }),
            control,
            d2: snapshot.d2,
            cost0: snapshot.cost0,
            cost: snapshot.cost,
            gradient: snapshot.gradient,
            trace: snapshot.trace,
            seconds: snapshot.seconds,
            termination: snapshot.termination,
            ..Self::new(options)
        }
    }

    /// Sets the termination from the reason for which the executor stopped, unless the solver itself has terminated.
    pub(crate) fn stopped_by_executor(&mut self, reason: Option<&TerminationReason>) {
        if self.termination.is_none() {
            self.termination = Some(match reason {
                Some(TerminationReason::Interrupt) => Termination::Interrupted,
                Some(TerminationReason::Timeout) => Termination::TimeLimit,
                _ => Termination::MaxIterations,
            });
        }
    }
}
