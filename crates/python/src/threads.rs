//! The threads that work, which live as long as a call or as the process that made them.
//!
//! A forked process has none of the threads of its parent, and rayon's global pool cannot be built again: whoever waits for it
//! there waits for ever. So nothing runs in the global pool. A long call has threads of its own; frames share threads that are
//! built again in every process.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuilder};
use tracing::Dispatch;
use tracing::dispatcher::with_default;

use crate::failure::{Failure, input};
use crate::unwound::caught;

/// Memory of a thread that works, bytes: as much as a main thread usually has.
const STACK: usize = 16 << 20;

/// Number of threads that was set; 0 for the number of cores, or what RAYON_NUM_THREADS says.
static NUMBER: AtomicUsize = AtomicUsize::new(0);

/// Threads that frames share.
pub(crate) static SHARED: FrameThreads = FrameThreads::new(None);

fn builder(number: usize) -> ThreadPoolBuilder {
    ThreadPoolBuilder::new().num_threads(number).thread_name(|i| format!("depthcal-{i}"))
}

fn not_started(error: impl std::fmt::Display) -> Failure {
    input(format!("threads cannot be started: {error}"))
}

/// Does the work of a long call in threads that are made for it and have ended when it returns. Log messages go to `log`.
pub(crate) fn in_threads_of_its_own<T: Send>(log: &Dispatch, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let builder = builder(NUMBER.load(Ordering::Relaxed)).stack_size(STACK);
    let started = |thread: ThreadBuilder| with_default(log, || thread.run());
    builder.build_scoped(started, |pool| pool.install(work)).map_err(not_started)
}

/// Threads for frames. They are started by the first call, and again by the first one in a forked process or with another number.
#[derive(Debug)]
pub(crate) struct FrameThreads {
    /// As [`set_threads`] says where there is none.
    number: Option<usize>,
    /// Locked with the GIL alone, which whoever forks has, so that no other thread has locked it then.
    started: Mutex<Option<Started>>,
}

#[derive(Debug)]
struct Started {
    process: u32,
    number: usize,
    pool: Arc<ThreadPool>,
}

impl Started {
    /// Ends the threads once nobody uses them. Those of a parent are forgotten: they are not there to be told.
    fn end(self) {
        if self.process != std::process::id() {
            std::mem::forget(self.pool);
        }
    }
}

impl FrameThreads {
    pub const fn new(number: Option<usize>) -> Self {
        Self { number, started: Mutex::new(None) }
    }

    /// Their number, where it was given.
    pub fn number(&self) -> Option<usize> {
        self.number
    }

    fn pool(&self, _with_the_gil: Python<'_>) -> Result<Arc<ThreadPool>, Failure> {
        let (process, number) = (std::process::id(), self.number.unwrap_or_else(|| NUMBER.load(Ordering::Relaxed)));
        let mut started = self.started.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(started) = started.as_ref().filter(|s| s.process == process && s.number == number) {
            return Ok(Arc::clone(&started.pool));
        }
        let pool = Arc::new(builder(number).build().map_err(not_started)?);
        if let Some(before) = started.replace(Started { process, number, pool: Arc::clone(&pool) }) {
            before.end();
        }
        Ok(pool)
    }

    /// Does the work in these threads without the GIL. Exceptions of Python code that it calls are those of the call.
    pub fn run<T: Send>(&self, py: Python<'_>, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
        let pool = self.pool(py)?;
        py.detach(|| caught(|| pool.install(work)))
    }
}

impl Drop for FrameThreads {
    fn drop(&mut self) {
        if let Some(started) = self.started.get_mut().unwrap_or_else(PoisonError::into_inner).take() {
            started.end();
        }
    }
}

/// Sets the number of threads of all further calls.
#[pyfunction]
pub(crate) fn set_threads(threads: usize) -> PyResult<()> {
    if threads == 0 {
        return Err(input("threads is 0; give at least 1").into());
    }
    NUMBER.store(threads, Ordering::Relaxed);
    Ok(())
}
