//! Where a command's words go: to standard output, or, when that carries a result for machines, to standard error.

use std::fmt::{Arguments, Display};
use std::io::{IsTerminal, Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;

/// Whether `--json` was given: one for the process, set once before any command runs.
static JSON: AtomicBool = AtomicBool::new(false);

/// Keeps standard output for the result.
pub(super) fn keep_stdout_for_json(json: bool) {
    JSON.store(json, Ordering::Relaxed);
}

/// Whether standard output belongs to the result.
pub(super) fn is_json() -> bool {
    JSON.load(Ordering::Relaxed)
}

/// Says a line; a reader that has gone away (`| head`) is no error.
pub(super) fn line(words: Arguments<'_>) {
    let _ = if is_json() { writeln!(stderr(), "{words}") } else { writeln!(stdout(), "{words}") };
}

/// `println!` that leaves standard output to `--json`.
macro_rules! say {
    ($($words:tt)*) => { $crate::voice::line(format_args!($($words)*)) };
}
pub(super) use say;

/// Writes the result of `--json`.
pub(super) fn result(value: &Value) {
    if is_json() {
        let _ = writeln!(stdout(), "{value:#}");
    }
}

/// Colours are for terminals whose user has not refused them (<https://no-color.org>).
pub(super) fn coloured() -> bool {
    stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

/// Says what is wrong, on standard error.
pub(super) fn complaint(kind: &str, code: u8, message: impl Display) {
    let (on, off) = match (coloured(), code) {
        (false, _) => ("", ""),
        (true, 0) => ("\x1b[1;33m", "\x1b[0m"),
        (true, _) => ("\x1b[1;31m", "\x1b[0m"),
    };
    let _ = writeln!(stderr(), "{on}{kind}:{off} {message}");
}
