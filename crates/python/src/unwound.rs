//! Panics of threads that work, as exceptions of Python.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::failure::{Error, Failure};

/// Unwinds the thread that works: Ctrl-C was pressed.
struct Interrupted;

/// Unwinds the thread that works: Python code that it called raised an exception.
struct Raised(PyErr);

/// Payload of an unwound thread.
pub(crate) type Payload = Box<dyn Any + Send>;

/// Leaves the library at once with an exception of Python code that it called. Only within [`caught`].
pub(crate) fn raise(error: PyErr) -> ! {
    resume_unwind(Box::new(Raised(error)))
}

/// Leaves the library at once because Ctrl-C was pressed. Only within [`caught`].
pub(crate) fn interrupt() -> ! {
    resume_unwind(Box::new(Interrupted))
}

/// Does the work; an unwound thread becomes an exception.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| Failure::Python(exception_of(payload)))
}

/// The exception for the payload with which the thread that worked was unwound.
pub(crate) fn exception_of(payload: Payload) -> PyErr {
    let payload = match payload.downcast::<Raised>() {
        Ok(raised) => return raised.0,
        Err(payload) => payload,
    };
    if payload.is::<Interrupted>() {
        return PyKeyboardInterrupt::new_err(());
    }
    let words = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
    let words = words.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default();
    Error::new_err(format!("depthcal failed where it must not: {words}; please report this as a bug"))
}
