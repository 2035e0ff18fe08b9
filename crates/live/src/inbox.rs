//! Events that wait for the session: frames, commands, fits, and the end of the source.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::arrival::Arrival;
use crate::command::Command;
use crate::fit::FitOutcome;

/// Most commands that wait; more are dropped, as from a key that is held down.
const MOST_COMMANDS: usize = 16;

/// How a source ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceEnd {
    /// The reason, where it is not simply its end.
    pub problem: Option<String>,
}

/// Something that the session has to see to.
#[derive(Debug)]
pub enum Event {
    /// A frame.
    Frame(Box<Arrival>),
    /// A request of the page.
    Command(Command),
    /// The end of a fit.
    Fitted(Box<FitOutcome>),
    /// The end of the source.
    Ended(SourceEnd),
}

#[derive(Debug, Default)]
struct Waiting {
    frame: Option<Box<Arrival>>,
    commands: VecDeque<Command>,
    fitted: Option<Box<FitOutcome>>,
    ended: Option<SourceEnd>,
    closed: bool,
}

/// The queue of a session. Commands come first, frames last: a person waits for what a key does. It holds one frame.
#[derive(Debug, Default)]
pub struct Inbox {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

impl Inbox {
    /// A thread that panicked has left nothing half done: every change is one assignment.
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Waiting)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    /// Puts a frame in the place of one that still waits; `false` once the inbox is closed.
    pub fn replace_frame(&self, arrival: Arrival) -> bool {
        let mut waiting = self.lock();
        waiting.frame = Some(Box::new(arrival));
        self.changed.notify_all();
        !waiting.closed
    }

    /// Waits until no frame waits, and puts one; `false` once the inbox is closed.
    pub fn put_frame(&self, arrival: Arrival) -> bool {
        let waiting = self.lock();
        let full = |waiting: &mut Waiting| waiting.frame.is_some() && !waiting.closed;
        let mut waiting = self.changed.wait_while(waiting, full).unwrap_or_else(PoisonError::into_inner);
        waiting.frame = Some(Box::new(arrival));
        self.changed.notify_all();
        !waiting.closed
    }

    /// Whether it is still open after a time.
    pub fn is_open_after(&self, time: Duration) -> bool {
        let wait = self.changed.wait_timeout_while(self.lock(), time, |waiting| !waiting.closed);
        !wait.unwrap_or_else(PoisonError::into_inner).0.closed
    }

    /// Puts a command.
    pub fn command(&self, command: Command) {
        self.change(|waiting| {
            if waiting.commands.len() < MOST_COMMANDS {
                waiting.commands.push_back(command);
            }
        });
    }

    /// Puts the outcome of a fit, in the place of an earlier one.
    pub fn fitted(&self, outcome: FitOutcome) {
        self.change(|waiting| waiting.fitted = Some(Box::new(outcome)));
    }

    /// Puts the end of the source.
    pub fn end(&self, end: SourceEnd) {
        self.change(|waiting| waiting.ended = Some(end));
    }

    /// No more frames are taken; sources end.
    pub fn close(&self) {
        self.change(|waiting| waiting.closed = true);
    }

    /// Waits for the next event.
    pub fn next(&self) -> Event {
        let mut waiting = self.lock();
        loop {
            let event = (waiting.commands.pop_front().map(Event::Command))
                .or_else(|| waiting.fitted.take().map(Event::Fitted))
                .or_else(|| waiting.frame.take().map(Event::Frame))
                .or_else(|| waiting.ended.take().map(Event::Ended));
            if let Some(event) = event {
                self.changed.notify_all();
                return event;
            }
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }
}
