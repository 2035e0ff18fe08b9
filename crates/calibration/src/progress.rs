//! Progress of long jobs, told to whoever wants to show it, and how long they took.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use crate::stage_clock::{Stage, StageClock, StageTimes};

/// Receives the progress of long jobs. A command line draws bars; [`Silent`] does nothing.
///
/// A receiver may end the work by unwinding (`std::panic::resume_unwind`) from any of these functions, or from those of a
/// [`Job`]: the library keeps no state that an unwound call could leave half changed.
pub trait Progress: fmt::Debug + Send + Sync {
    /// A job begins; `steps` is how many it has, where that is known.
    fn begin(&self, job: &'static str, steps: Option<usize>) -> Box<dyn Job>;
    /// A stage begins of which only the time is of interest: a moment to look whether the work is still wanted.
    fn stage(&self, _stage: &str) {}
}

/// A job in progress. It ends when this is dropped.
pub trait Job: fmt::Debug + Send + Sync {
    /// Tells what the job is doing now.
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

/// A shared receiver of progress, as options hold it, with the clock of a run. Every job is a stage of the run; what
/// a job says that it is doing begins a stage of its own.
#[derive(Debug, Clone)]
pub struct ProgressHandle {
    progress: Arc<dyn Progress>,
    clock: StageClock,
}

impl ProgressHandle {
    /// A handle on a receiver, with a clock that starts now.
    pub fn new(progress: impl Progress + 'static) -> Self {
        Self { progress: Arc::new(progress), clock: StageClock::new() }
    }

    /// A job of so many steps begins.
    pub fn steps(&self, job: &'static str, steps: usize) -> Box<dyn Job> {
        self.begin(job, Some(steps))
    }

    /// A job begins whose steps cannot be counted beforehand.
    pub fn open_ended(&self, job: &'static str) -> Box<dyn Job> {
        self.begin(job, None)
    }

    fn begin(&self, job: &'static str, steps: Option<usize>) -> Box<dyn Job> {
        let now = Mutex::new(Now { stage: Some(self.clock.begin(job)), is_told: false });
        Box::new(TimedJob { job: self.progress.begin(job, steps), clock: self.clock.clone(), now })
    }

    /// A stage begins of which only the time is of interest; it ends when the result is dropped. Within another stage
    /// it is a part of that one.
    pub fn stage(&self, stage: &str) -> Stage {
        self.progress.stage(stage);
        self.clock.begin(stage)
    }

    /// The times of the stages that have ended.
    pub fn stage_times(&self) -> StageTimes {
        self.clock.times()
    }
}

impl Default for ProgressHandle {
    fn default() -> Self {
        Self::new(Silent)
    }
}

/// A job whose time is measured.
#[derive(Debug)]
struct TimedJob {
    job: Box<dyn Job>,
    clock: StageClock,
    now: Mutex<Now>,
}

/// Present activity of a job.
#[derive(Debug)]
struct Now {
    stage: Option<Stage>,
    /// Whether the job itself has said what it is doing.
    is_told: bool,
}

impl Job for TimedJob {
    fn doing(&self, what: String) {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        let is_first = !std::mem::replace(&mut now.is_told, true);
        match &mut now.stage {
            // The moment until a job says what it does first is no stage.
            Some(stage) if is_first => stage.rename(what.as_str()),
            _ => {
                // The old stage has to end before the new one begins, which would else be a part of it.
                now.stage = None;
                now.stage = Some(self.clock.begin(what.as_str()));
            }
        }
        self.job.doing(what);
    }

    fn advance(&self) {
        self.job.advance();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_and_what_they_do_are_stages() {
        let handle = ProgressHandle::default();
        drop(handle.steps("reading images", 3));
        {
            let job = handle.open_ended("diagnosing");
            job.doing("round 1: fitting".to_owned());
            let _part = handle.stage("joint adjustment");
            job.doing("round 1: judging".to_owned());
            job.advance();
        }
        let names: Vec<String> = handle.clone().stage_times().stages.into_iter().map(|s| s.stage).collect();
        assert_eq!(names, ["reading images", "round 1: fitting", "round 1: judging"]);
    }
}
