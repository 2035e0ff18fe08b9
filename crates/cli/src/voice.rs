//! Everything that the program writes to standard output and standard error, but for progress bars and log messages.
//!
//! Messages go to standard output, or to standard error where standard output carries a result: JSON or frames. A reader that
//! has gone away (`| head`) is no error.

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

/// Writes a line of a message.
pub(super) fn line(words: Arguments<'_>) {
    let _ = if is_json() { writeln!(stderr(), "{words}") } else { writeln!(stdout(), "{words}") };
}

/// `println!` that leaves standard output to `--json`.
macro_rules! say {
    ($($words:tt)*) => { $crate::voice::line(format_args!($($words)*)) };
}
pub(super) use say;

/// Writes a line to standard error.
pub(super) fn note_line(words: Arguments<'_>) {
    let _ = writeln!(stderr(), "{words}");
}

/// `eprintln!` for commands whose standard output carries frames.
macro_rules! note {
    ($($words:tt)*) => { $crate::voice::note_line(format_args!($($words)*)) };
}
pub(super) use note;

/// Writes a document, such as a manual page, to standard output.
pub(super) fn document(bytes: &[u8]) {
    let _ = stdout().write_all(bytes);
}

/// Standard output, for frames.
pub(super) fn frames() -> impl Write {
    stdout().lock()
}

/// Writes the usage, the help or the version, as clap words and colours them.
pub(super) fn usage(message: &clap::Error) {
    let _ = message.print();
}

/// Writes the result of `--json`.
pub(super) fn result(value: &Value) {
    if is_json() {
        let _ = writeln!(stdout(), "{value:#}");
    }
}

/// Whether standard error shows colours: on a terminal whose user has not refused them (<https://no-color.org>).
pub(super) fn coloured() -> bool {
    stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

/// Writes an error (`code` above 0) or a warning (0) to standard error.
pub(super) fn complaint(kind: &str, code: u8, message: impl Display) {
    let (on, off) = match (coloured(), code) {
        (false, _) => ("", ""),
        (true, 0) => ("\x1b[1;33m", "\x1b[0m"),
        (true, _) => ("\x1b[1;31m", "\x1b[0m"),
    };
    let _ = writeln!(stderr(), "{on}{kind}:{off} {message}");
}
