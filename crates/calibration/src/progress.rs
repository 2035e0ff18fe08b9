//! Progress of long jobs, told to whoever wants to show it.

use std::fmt;
use std::sync::Arc;

/// Receives the progress of long jobs. A command line draws bars; [`Silent`] does nothing.
pub trait Progress: fmt::Debug + Send + Sync {
    /// A job begins; `steps` is how many it has, where that is known.
    fn begin(&self, job: &'static str, steps: Option<usize>) -> Box<dyn Job>;
}

/// A job in progress. It ends when this is dropped.
pub trait Job: fmt::Debug + Send + Sync {
    /// What the job is doing now.
    fn doing(&self, what: String);
    /// One step is done. Called from any thread.
    fn advance(&self);
}

/// Shows nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &'static str, _: Option<usize>) -> Box<dyn Job> {
        Box::new(Silent)
    }
}

impl Job for Silent {
    fn doing(&self, _: String) {}
    fn advance(&self) {}
}

/// A shared receiver of progress, as options hold it.
#[derive(Debug, Clone)]
pub struct ProgressHandle(Arc<dyn Progress>);

impl ProgressHandle {
    /// A handle on a receiver.
    pub fn new(progress: impl Progress + 'static) -> Self {
        Self(Arc::new(progress))
    }

    /// A job of so many steps begins.
    pub fn steps(&self, job: &'static str, steps: usize) -> Box<dyn Job> {
        self.0.begin(job, Some(steps))
    }

    /// A job begins whose steps cannot be counted beforehand.
    pub fn open_ended(&self, job: &'static str) -> Box<dyn Job> {
        self.0.begin(job, None)
    }
}

impl Default for ProgressHandle {
    fn default() -> Self {
        Self::new(Silent)
    }
}
