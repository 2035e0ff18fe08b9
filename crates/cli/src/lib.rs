//! The command line of depthcal, for its own binary and for programs with models of their own.
//!
//! [`run`] is a whole program: it parses the arguments, runs the command, and returns the exit code. Every command that
//! reads models by name knows the pieces of the [`Register`](depthcal_model::Register) that it is given, so that a program
//! with a depth model of its own has it in `calibrate`, `compare`, `diagnose`, `apply`, `evaluate` and `export`:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     let mut register = depthcal_model::Register::builtin();
//!     // register.add(|_| MyModel);
//!     depthcal_cli::run(register)
//! }
//! ```
//!
//! One file per command, a folder for `apply`. Every command takes datasets of one camera or of several. `arguments` has the list
//! of commands, `common` the options and files that several share, `session` the register, the progress bars and the clock of one
//! run. `voice` is the only module that writes to standard output or standard error, except for progress bars (`progress`) and
//! log messages (`log_writer`).

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "the command line is what prints")]

mod apply;
mod arguments;
mod board;
#[cfg(any(feature = "import", feature = "live"))]
mod board_file;
mod calibrate;
mod common;
mod compare;
mod completions;
mod demo;
mod detect;
mod diagnose;
mod diagnosis_output;
mod diff;
#[cfg(test)]
mod documented_commands;
mod evaluate;
mod export;
mod failure;
mod fleet;
mod formula;
mod goal_options;
#[cfg(feature = "import")]
mod import;
#[cfg(feature = "live")]
mod live;
mod log_writer;
mod man;
mod model_options;
mod next;
mod next_command;
mod parameters;
mod progress;
mod recording;
mod results;
mod run;
mod schema;
mod select;
mod session;
mod simulate;
mod stage_table;
mod transfers;
mod voice;

pub use run::run;
