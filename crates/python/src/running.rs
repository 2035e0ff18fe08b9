//! Long calls: without the GIL, in threads of their own, while the calling thread shows progress and listens for Ctrl-C.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use depthcal_calibration::progress::{Job, Progress, ProgressHandle};
use pyo3::prelude::*;

use crate::failure::{Failure, input};
use crate::threads::in_threads_of_its_own;
use crate::unwound::{caught, exception_of, interrupt};
use crate::warned::Warnings;
use crate::words::Words;

/// How often the calling thread looks for signals.
const LISTENING: Duration = Duration::from_millis(50);

/// A message of the thread that works to the one that called.
enum Event {
    /// A job begins: its number, its name, its steps where they are known.
    Begin(usize, &'static str, Option<usize>),
    /// A job does something else: its number, and words for it.
    Doing(usize, String),
    /// A step of a job is done.
    Advance(usize),
    /// A job ends.
    End(usize),
    /// All is done.
    Done,
}

#[derive(Debug)]
struct Reporter {
    sender: Sender<Event>,
    interrupted: Arc<AtomicBool>,
    jobs: AtomicUsize,
}

/// Leaves the library where Ctrl-C was pressed.
fn check(interrupted: &AtomicBool) {
    if interrupted.load(Ordering::Relaxed) && !std::thread::panicking() {
        interrupt();
    }
}

impl Progress for Reporter {
    fn begin(&self, job: &'static str, steps: Option<usize>) -> Box<dyn Job> {
        check(&self.interrupted);
        let number = self.jobs.fetch_add(1, Ordering::Relaxed);
        let _ = self.sender.send(Event::Begin(number, job, steps));
        Box::new(ReportedJob { number, sender: self.sender.clone(), interrupted: self.interrupted.clone() })
    }

    fn stage(&self, _: &str) {
        check(&self.interrupted);
    }
}

#[derive(Debug)]
struct ReportedJob {
    number: usize,
    sender: Sender<Event>,
    interrupted: Arc<AtomicBool>,
}

impl Job for ReportedJob {
    fn doing(&self, what: String) {
        check(&self.interrupted);
        let _ = self.sender.send(Event::Doing(self.number, what));
    }

    fn advance(&self) {
        check(&self.interrupted);
        let _ = self.sender.send(Event::Advance(self.number));
    }
}

impl Drop for ReportedJob {
    fn drop(&mut self) {
        let _ = self.sender.send(Event::End(self.number));
    }
}

/// Runs `work` without the GIL in threads of its own. Progress goes to `show`, called with (event, number of the job, text,
/// steps) in the calling thread. Ctrl-C ends the work at its next stage and raises KeyboardInterrupt; an exception of `show` or
/// of Python code that the work calls ends it as well. Warnings of the library are given to Python when the work has ended.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    show: Option<&Py<PyAny>>,
    work: impl FnOnce(&ProgressHandle) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    run_in(Words::Files, py, show, work)
}

/// [`run`], with messages in the words of the caller.
pub(crate) fn run_in<T: Send>(
    words: Words,
    py: Python<'_>,
    show: Option<&Py<PyAny>>,
    work: impl FnOnce(&ProgressHandle) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    let receiver = Mutex::new(receiver);
    let interrupted = Arc::new(AtomicBool::new(false));
    let reporter = Reporter { sender: sender.clone(), interrupted: interrupted.clone(), jobs: AtomicUsize::new(0) };
    let mut raised = None;
    let warnings = Warnings::default();
    let dispatch = warnings.dispatch();
    let outcome = std::thread::scope(|scope| {
        let worker = std::thread::Builder::new().name("depthcal".to_owned()).spawn_scoped(scope, move || {
            let handle = ProgressHandle::new(reporter);
            let outcome = caught(|| in_threads_of_its_own(&dispatch, || work(&handle)).flatten()).flatten();
            let _ = sender.send(Event::Done);
            outcome
        });
        let worker = match worker {
            Ok(worker) => worker,
            Err(error) => return Err(input(format!("no thread can be started: {error}"))),
        };
        listen(py, show, &receiver, &interrupted, &mut raised);
        py.detach(|| worker.join()).unwrap_or_else(|payload| Err(Failure::Python(exception_of(payload))))
    });
    if let Some(error) = raised {
        return Err(error);
    }
    // The reason of a failure before an error that a warning is turned into.
    let told = warnings.tell(py, words);
    let result = outcome.map_err(|failure| words.of_failure(failure))?;
    told.map(|()| result)
}

/// Shows progress and listens for signals until all is done.
fn listen(
    py: Python<'_>,
    show: Option<&Py<PyAny>>,
    receiver: &Mutex<Receiver<Event>>,
    interrupted: &AtomicBool,
    raised: &mut Option<PyErr>,
) {
    loop {
        let event = py.detach(|| receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LISTENING));
        let shown = match (&event, show) {
            (Ok(Event::Done) | Err(RecvTimeoutError::Disconnected), _) => return,
            (Err(RecvTimeoutError::Timeout), _) | (_, None) => Ok(()),
            (Ok(event), Some(show)) if raised.is_none() => tell(py, show, event),
            _ => Ok(()),
        };
        if raised.is_none()
            && let Err(error) = shown.and_then(|()| py.check_signals())
        {
            *raised = Some(error);
            interrupted.store(true, Ordering::Relaxed);
        }
    }
}

fn tell(py: Python<'_>, show: &Py<PyAny>, event: &Event) -> PyResult<()> {
    let told = match event {
        Event::Begin(job, text, steps) => ("begin", *job, *text, *steps),
        Event::Doing(job, text) => ("doing", *job, text.as_str(), None),
        Event::Advance(job) => ("advance", *job, "", None),
        Event::End(job) => ("end", *job, "", None),
        Event::Done => return Ok(()),
    };
    show.call1(py, told).map(drop)
}
