//! Stopping, and going on from a snapshot.

use std::path::PathBuf;

use argmin::core::TerminationReason;

use super::LevenbergMarquardt;
use crate::options::Options;
use crate::report::Termination;
use crate::snapshot::{Resumed, Snapshot, setup};

impl LevenbergMarquardt {
    /// What it takes to go on from here.
    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot {
            setup: setup(&self.options),
            rows: self.system.as_ref().map_or(0, |s| s.layout.rows),
            mu: self.mu,
            nu: self.nu,
            radius: self.radius,
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

    /// A solver that goes on from a snapshot.
    pub(crate) fn resume(options: Options, snapshot: Snapshot, path: PathBuf) -> Self {
        let resumed =
            Resumed { path, rows: snapshot.rows, cost: snapshot.cost, first_prediction: snapshot.first_prediction };
        Self {
            resumed: Some(resumed),
            mu: snapshot.mu,
            nu: snapshot.nu,
            radius: snapshot.radius,
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

    /// Takes over why an executor stopped.
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
