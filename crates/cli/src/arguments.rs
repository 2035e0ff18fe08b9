//! The arguments of the program and its commands.

use std::path::Path;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use depthcal_model::Register;
use serde_json::Value;

use super::apply::Apply;
use super::board::Board;
use super::calibrate::Calibrate;
use super::compare::Compare;
use super::completions::Completions;
use super::demo::Demo;
use super::detect::Detect;
use super::diagnose::Diagnose;
use super::diff::Diff;
use super::evaluate::Evaluate;
use super::export::Export;
use super::failure::Failure;
use super::fleet::Fleet;
use super::formula::Formula;
use super::man::ManPage;
use super::next::Next;
use super::schema::Schema;
use super::select::Select;
use super::session::Session;
use super::simulate::Simulate;

/// Calibrates depth cameras: intrinsics, lens, depth distortion and board poses in one joint adjustment.
///
/// A dataset is a folder with a dataset.toml that declares the board, the images and the depth
/// images. Without captures of your own, start with `depthcal demo`, which simulates some.
#[derive(Debug, Parser)]
#[command(name = "depthcal", version, verbatim_doc_comment, max_term_width = 120, after_help = GUIDE)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Command,
    /// Number of threads [default: RAYON_NUM_THREADS, else all cores]. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    pub(super) threads: Option<usize>,
    /// Writes the result as JSON to standard output; messages go to standard error.
    #[arg(long, global = true)]
    pub(super) json: bool,
    /// More log messages (-v: info, and the time of every stage; -vv: debug).
    #[arg(long, short, global = true, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
}

/// Commands whose results go into a folder, and that folder where none is given.
const FOLDERS: [(&str, &str); 10] = [
    ("calibrate", "depthcal-out/calibrate"),
    ("diagnose", "depthcal-out/diagnose"),
    ("evaluate", "depthcal-out/evaluate"),
    ("compare", "depthcal-out/compare"),
    ("diff", "depthcal-out/diff"),
    ("fleet", "depthcal-out/fleet"),
    ("simulate", "depthcal-out/simulate"),
    ("board", "depthcal-out/board/board.pdf"),
    ("import", "depthcal-out/import"),
    ("live", "depthcal-out/live"),
];

impl Arguments {
    /// The parser of the command line, with the folders of results that commands have by default.
    pub(super) fn parser() -> clap::Command {
        let mut parser = Self::command();
        for (name, folder) in FOLDERS {
            if parser.find_subcommand(name).is_some() {
                parser = parser.mut_subcommand(name, |command| {
                    command.mut_arg("out", |out| out.required(false).default_value(folder))
                });
            }
        }
        parser
    }

    /// The arguments of the process, and the name of the command.
    pub(super) fn of_process() -> Result<(Self, String), clap::Error> {
        let matches = Self::parser().try_get_matches()?;
        let name = matches.subcommand_name().unwrap_or_default().to_owned();
        Ok((Self::from_arg_matches(&matches)?, name))
    }
}

/// The usual order of commands, exit codes, and environment variables.
const GUIDE: &str = "\
From captures to corrected depth:
  depthcal detect captures/                        is the board found in every image?
  depthcal calibrate captures/ --cross-validate 3 --out result/
  depthcal diagnose captures/ --out result/        which effects does the model lack? adds them
  depthcal next captures/                          which captures to add, and how many are enough
  depthcal live frames/ --board board.toml         … while the board is in your hands, on a page in the browser
  depthcal evaluate result/calibration.json other-captures/ --out check/
  depthcal apply result/calibration.json depth/ --out corrected/ --cloud
Commands with --out (default: depthcal-out/COMMAND) write their results there as JSON and, where they measure errors, report.html,
which is to be opened first.

Exit codes:
  0  done
  1  invalid input or arguments; the message says how to correct them
  2  the fit cannot be trusted (not converged, parameters undetermined, model not invertible); the message says why

Environment:
  DEPTHCAL_CACHE     folder for detected boards (default: the user's cache folder)
  DEPTHCAL_LOG       log filter, such as info or depthcal=debug (as --verbose)
  RAYON_NUM_THREADS  number of threads (as --threads)
  NO_COLOR           no colours on terminals";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Detect(Detect),
    Calibrate(Calibrate),
    Diagnose(Diagnose),
    Evaluate(Evaluate),
    Compare(Compare),
    Next(Next),
    Select(Select),
    #[cfg(feature = "live")]
    Live(super::live::Live),
    Diff(Diff),
    Fleet(Fleet),
    Apply(Apply),
    Export(Export),
    Board(Board),
    #[cfg(feature = "import")]
    Import(super::import::Import),
    Schema(Schema),
    Simulate(Simulate),
    Formula(Formula),
    Demo(Demo),
    Completions(Completions),
    Man(ManPage),
}

impl Command {
    /// The folder of its results, of those that replace earlier results in it.
    pub(super) fn results(&self) -> Option<&Path> {
        let output = match self {
            Command::Calibrate(command) => &command.output,
            Command::Diagnose(command) => &command.output,
            Command::Compare(command) => &command.output,
            Command::Evaluate(command) => &command.output,
            Command::Diff(command) => &command.output,
            Command::Fleet(command) => &command.output,
            _ => return None,
        };
        Some(&output.out)
    }

    /// Reads the files of formulas that its options name.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        match self {
            Command::Calibrate(command) => command.load_formulas(register),
            Command::Diagnose(command) => command.model.load_formulas(register),
            Command::Compare(command) => command.load_formulas(register),
            Command::Next(command) => command.model.load_formulas(register),
            Command::Select(command) => command.model.load_formulas(register),
            #[cfg(feature = "live")]
            Command::Live(command) => command.model.load_formulas(register),
            Command::Evaluate(command) => command.load_formulas(register),
            _ => Ok(()),
        }
    }

    /// Runs the command; returns the result that `--json` writes.
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        match self {
            Command::Detect(command) => command.run(session),
            Command::Calibrate(command) => command.run(session),
            Command::Diagnose(command) => command.run(session),
            Command::Evaluate(command) => command.run(session),
            Command::Compare(command) => command.run(session),
            Command::Next(command) => command.run(session),
            Command::Select(command) => command.run(session),
            #[cfg(feature = "live")]
            Command::Live(command) => command.run(session),
            Command::Diff(command) => command.run(session),
            Command::Fleet(command) => command.run(session),
            Command::Apply(command) => command.run(session),
            Command::Export(command) => command.run(session),
            Command::Board(command) => command.run(),
            #[cfg(feature = "import")]
            Command::Import(command) => command.run(session),
            Command::Schema(command) => command.run(),
            Command::Simulate(command) => command.run(),
            Command::Formula(command) => command.run(),
            Command::Demo(command) => command.run(session),
            Command::Completions(command) => command.run(Arguments::parser()),
            Command::Man(command) => command.run(Arguments::parser()),
        }
    }
}
