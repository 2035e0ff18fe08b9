//! A thread that fits, so that the picture never waits.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread;

use crate::fit::{FitJob, LiveFit, fit};
use crate::inbox::Inbox;

#[derive(Debug, Default)]
struct Slot {
    job: Option<FitJob>,
    is_busy: bool,
    closed: bool,
}

/// A thread that fits. Of jobs that come while it works the newest counts.
#[derive(Debug)]
pub struct Fitter {
    slot: Arc<(Mutex<Slot>, Condvar)>,
}

impl Fitter {
    /// Starts the thread, which puts outcomes into the inbox.
    pub fn start(live: LiveFit, inbox: Arc<Inbox>) -> Self {
        let slot = Arc::new((Mutex::new(Slot::default()), Condvar::new()));
        let shared = slot.clone();
        thread::spawn(move || {
            let (slot, changed) = &*shared;
            loop {
                let idle = |slot: &mut Slot| slot.job.is_none() && !slot.closed;
                let locked = slot.lock().unwrap_or_else(PoisonError::into_inner);
                let mut locked = changed.wait_while(locked, idle).unwrap_or_else(PoisonError::into_inner);
                if locked.closed {
                    return;
                }
                let Some(job) = locked.job.take() else { continue };
                locked.is_busy = true;
                drop(locked);
                let outcome = fit(job, &live);
                slot.lock().unwrap_or_else(PoisonError::into_inner).is_busy = false;
                inbox.fitted(outcome);
            }
        });
        Self { slot }
    }

    /// Gives it a job, in the place of one that waits.
    pub fn submit(&self, job: FitJob) {
        self.slot.0.lock().unwrap_or_else(PoisonError::into_inner).job = Some(job);
        self.slot.1.notify_all();
    }

    /// Whether it fits, or is about to.
    pub fn is_busy(&self) -> bool {
        let slot = self.slot.0.lock().unwrap_or_else(PoisonError::into_inner);
        slot.is_busy || slot.job.is_some()
    }
}

impl Drop for Fitter {
    fn drop(&mut self) {
        self.slot.0.lock().unwrap_or_else(PoisonError::into_inner).closed = true;
        self.slot.1.notify_all();
    }
}
