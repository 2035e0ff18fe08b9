//! Wall time of the stages of a run.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tracing::{debug, info};

/// The time of one stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Wall time, s; of all occurrences together.
    pub seconds: f64,
}

/// The times of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StageTimes {
    /// The stages, in the order in which they first ended. No two overlap in time.
    pub stages: Vec<StageTime>,
    /// Wall time since the clock was made, s: that of the stages and of what lies between them.
    pub elapsed_s: f64,
}

impl StageTimes {
    /// Wall time that belongs to no stage, s.
    pub fn rest_s(&self) -> f64 {
        (self.elapsed_s - self.stages.iter().map(|s| s.seconds).sum::<f64>()).max(0.0)
    }
}

/// Measures the wall time of stages. Clones share the clock.
///
/// Only one stage is measured at a time: a stage that begins while another has not ended, in the same thread or in
/// any other, is a part of that one and is not counted again. The times therefore add up to no more than the run
/// took.
#[derive(Debug, Clone)]
pub struct StageClock(Arc<Clock>);

#[derive(Debug)]
struct Clock {
    started: Instant,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Whether a stage is being measured.
    busy: bool,
    ended: Vec<StageTime>,
}

impl Clock {
    /// A thread that panicked while it held the lock leaves at worst a time out.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl StageClock {
    /// A clock that starts now.
    pub fn new() -> Self {
        Self(Arc::new(Clock { started: Instant::now(), state: Mutex::default() }))
    }

    /// A stage begins; it ends when the result is dropped.
    pub fn begin(&self, stage: impl Into<String>) -> Stage {
        let mut state = self.0.state();
        let is_part = std::mem::replace(&mut state.busy, true);
        Stage { clock: self.0.clone(), name: stage.into(), started: Instant::now(), is_part }
    }

    /// The times of all stages that have ended.
    pub fn times(&self) -> StageTimes {
        StageTimes { stages: self.0.state().ended.clone(), elapsed_s: self.0.started.elapsed().as_secs_f64() }
    }
}

impl Default for StageClock {
    fn default() -> Self {
        Self::new()
    }
}

/// A stage in progress. It ends when this is dropped.
#[derive(Debug)]
#[must_use = "the stage ends when this is dropped"]
pub struct Stage {
    clock: Arc<Clock>,
    name: String,
    started: Instant,
    /// Whether it is a part of another stage.
    is_part: bool,
}

impl Stage {
    /// Gives it another name, under which its whole time will count.
    pub fn rename(&mut self, stage: impl Into<String>) {
        self.name = stage.into();
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let seconds = self.started.elapsed().as_secs_f64();
        let (name, shown) = (std::mem::take(&mut self.name), in_words(seconds));
        if self.is_part {
            debug!("{name}: {shown}");
            return;
        }
        info!("{name}: {shown}");
        let mut state = self.clock.state();
        state.busy = false;
        match state.ended.iter_mut().find(|s| s.stage == name) {
            Some(same) => same.seconds += seconds,
            None => state.ended.push(StageTime { stage: name, seconds }),
        }
    }
}

/// A time with three significant digits and a unit: `123 µs`, `4.56 ms`, `12.3 s`, `1234 s`.
pub fn in_words(seconds: f64) -> String {
    let (value, unit) = match seconds {
        // Limits at which three digits round up to the next unit.
        s if s < 0.999_5e-3 => (1e6 * s, "µs"),
        s if s < 0.999_5 => (1e3 * s, "ms"),
        s => (s, "s"),
    };
    let decimals = match value {
        v if v < 9.995 => 2,
        v if v < 99.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$} {unit}")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const NAP: Duration = Duration::from_millis(20);

    fn nap_in(clock: &StageClock, stage: &str) {
        let _stage = clock.begin(stage);
        std::thread::sleep(NAP);
    }

    #[test]
    fn the_time_of_every_stage_is_recorded() {
        let clock = StageClock::new();
        nap_in(&clock, "reading");
        nap_in(&clock, "fitting");
        std::thread::sleep(NAP);
        nap_in(&clock, "reading");
        let times = clock.times();
        let names: Vec<&str> = times.stages.iter().map(|s| s.stage.as_str()).collect();
        assert_eq!(names, ["reading", "fitting"]);
        assert!(times.stages[0].seconds >= 2.0 * NAP.as_secs_f64(), "both occurrences: {times:?}");
        assert!(times.stages[1].seconds >= NAP.as_secs_f64(), "{times:?}");
        assert!(times.rest_s() >= NAP.as_secs_f64(), "the nap outside of the stages: {times:?}");
        let sum: f64 = times.stages.iter().map(|s| s.seconds).sum();
        assert!((sum + times.rest_s() - times.elapsed_s).abs() < 1e-9, "{times:?}");
    }

    /// Stages within stages, in this thread and in others, belong to the outermost one.
    #[test]
    fn nested_stages_are_not_counted_twice() {
        let clock = StageClock::new();
        let whole = clock.begin("cross-validating");
        nap_in(&clock, "joint adjustment");
        std::thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| nap_in(&clock, "joint adjustment"));
            }
        });
        assert!(clock.times().stages.is_empty(), "nothing has ended");
        drop(whole);
        let times = clock.times();
        assert_eq!(times.stages.len(), 1, "{times:?}");
        assert_eq!(times.stages[0].stage, "cross-validating");
        assert!(times.stages[0].seconds <= times.elapsed_s, "{times:?}");
        // The next stage is one of its own again.
        nap_in(&clock, "joint adjustment");
        assert_eq!(clock.times().stages.len(), 2);
    }

    /// Stages that run side by side take no more than the time that passes.
    #[test]
    fn stages_side_by_side_never_exceed_the_elapsed_time() {
        let clock = StageClock::new();
        std::thread::scope(|scope| {
            for i in 0..8 {
                let clock = &clock;
                scope.spawn(move || nap_in(clock, if i % 2 == 0 { "even" } else { "odd" }));
            }
        });
        let times = clock.times();
        let sum: f64 = times.stages.iter().map(|s| s.seconds).sum();
        assert!(sum > 0.0 && sum <= times.elapsed_s, "{times:?}");
    }

    #[test]
    fn times_have_three_digits_and_a_unit() {
        let words = [1.234e-5, 0.99949e-3, 0.9996e-3, 0.04567, 0.9996, 9.996, 99.96, 1234.5].map(in_words);
        assert_eq!(words, ["12.3 µs", "999 µs", "1.00 ms", "45.7 ms", "1.00 s", "10.0 s", "100 s", "1234 s"]);
    }
}
