//! The program: arguments in, exit code out.

use std::process::ExitCode;

use depthcal_model::Register;
use serde_json::json;
use tracing_subscriber::EnvFilter;

use super::arguments::Arguments;
use super::failure::Failure;
use super::log_writer::LogWriter;
use super::results::earlier_results;
use super::session::Session;
use super::stage_table::{seconds_of, stage_table};
use super::voice;

/// Runs the program: parses the arguments of the process, runs the command with the pieces of `register`, writes messages and
/// results, and returns the exit code: 0 done, 1 invalid input or arguments, 2 a fit that cannot be trusted.
pub fn run(mut register: Register) -> ExitCode {
    let (mut arguments, name) = match Arguments::of_process() {
        Ok(arguments) => arguments,
        Err(error) => {
            voice::usage(&error);
            return if error.use_stderr() { ExitCode::from(1) } else { ExitCode::SUCCESS };
        }
    };
    let level = ["warn", "info", "debug"][usize::from(arguments.verbose.min(2))];
    let filter = EnvFilter::try_from_env("DEPTHCAL_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| LogWriter)
        .with_ansi(voice::coloured())
        .with_target(false)
        .without_time()
        .init();
    if let Some(threads) = arguments.threads {
        if threads == 0 {
            voice::complaint("error", 1, "--threads is 0; give at least 1");
            return ExitCode::from(1);
        }
        // Fails only where the thread pool exists already, which is not the case this early.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    }
    voice::keep_stdout_for_json(arguments.json);
    let loaded = arguments.command.load_formulas(&mut register);
    let session = Session::new(register);
    let (code, mut value) = match loaded.and_then(|()| arguments.command.run(&session)) {
        Ok(value) => (0, value),
        Err(failure) => {
            let (kind, code, message) = match failure {
                Failure::Input(message) => ("error", 1, message),
                Failure::Untrusted(message) => ("the fit cannot be trusted", 2, message),
            };
            voice::complaint(kind, code, &message);
            let earlier = arguments.command.results().filter(|_| !session.has_committed()).and_then(earlier_results);
            let mut value = json!({ "error": message });
            if let Some((sentence, files)) = earlier {
                voice::note_line(format_args!("{sentence}"));
                value["of_an_earlier_run"] = json!(files);
            }
            (code, value)
        }
    };
    if let (0, Some(next)) = (code, arguments.command.next(&value)) {
        voice::line(format_args!("next: {next}"));
        value["next"] = json!(next);
    }
    let times = session.progress.stage_times();
    if tracing::enabled!(tracing::Level::INFO) && !times.stages.is_empty() {
        voice::note_line(format_args!("{}", stage_table(&times)));
    }
    if !value.is_null() {
        value["stages"] = json!(times.stages.iter().map(seconds_of).collect::<Vec<_>>());
        value["command"] = json!(name);
        value["exit_code"] = json!(code);
        voice::result(&value);
    }
    ExitCode::from(code)
}
