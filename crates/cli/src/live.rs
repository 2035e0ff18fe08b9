//! `live`: guided capture.

use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_calibration::load::{LoadOptions, default_cache, load};
use depthcal_calibration::task::{FitRequest, NextRequest};
use depthcal_detect::DetectOptions;
use depthcal_live::{Ended, LiveFit, LiveOptions, Source};
use depthcal_report::format::count;
use serde_json::{Value, json};

use super::board_file::read_board;
use super::common::{above_zero, made};
use super::failure::{Failure, input};
use super::goal_options::GoalOptions;
use super::model_options::ModelOptions;
use super::progress::Progress;
use super::results::save;
use super::session::Session;
use super::voice::say;

/// Parts of the cross-validation of the calibration at the end.
const PARTS: usize = 3;
/// Fewest frames for it.
const FEWEST: usize = 6;

/// Guides a capture while the board is in your hands: a page shows the picture, the wanted pose, and when it is enough.
///
/// Frames that show the board sharply, at rest and in another place are kept as a dataset in --out, each at once; a session that
/// was killed goes on with them. Space captures, z takes back. At the end the dataset is calibrated, with the results in
/// the calibration/ folder of --out. The page is for this machine alone unless --share is given.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal live frames/ --board board.toml --unit-mm 1 --out captures/     a folder that a camera's program fills
  camera-program | depthcal live - --board board.toml --out captures/      raw frames; docs/live.md has such programs
  depthcal live frames/ --board board.toml --share                         the page on a tablet next to the board")]
pub(super) struct Live {
    /// A folder that fills, with image/ and depth/, with images alone, or with a dataset.toml; or - for raw frames on standard
    /// input.
    source: PathBuf,
    /// A file with a section [board], as `depthcal board` writes it, or a dataset.toml.
    #[arg(long, value_name = "FILE")]
    board: PathBuf,
    /// Folder for the dataset; frames of an earlier session in it are continued.
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Millimetres per step of the depth images in the folder; a dataset.toml there, and raw frames, say it themselves.
    #[arg(long, value_name = "MM")]
    unit_mm: Option<f64>,
    /// The folder is filled by a camera that runs: frames in which the board moves are not kept. Raw frames are always so.
    #[arg(long)]
    video: bool,
    /// Port of the page; 0 takes any that is free.
    #[arg(long, value_name = "N", default_value_t = 8345)]
    port: u16,
    /// Shows the page to the local network as well, at an address with a secret.
    #[arg(long)]
    share: bool,
    #[command(flatten)]
    goal: GoalOptions,
    /// Error that is small enough, as for `next`.
    #[arg(long, value_name = "X")]
    within: Option<f64>,
    #[command(flatten)]
    pub(super) model: ModelOptions,
}

impl Live {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        above_zero("--within", self.within, "a number above 0, such as 1")?;
        above_zero("--unit-mm", self.unit_mm, "a number above 0, such as 1")?;
        let request = self.model.request();
        request.check(1, &session.register)?;
        let options = LiveOptions {
            target: read_board(&self.board)?,
            out: self.out.clone(),
            port: self.port,
            share: self.share,
            detect: DetectOptions::default(),
            fit: LiveFit {
                request: request.clone(),
                options: session.calibrate_options(),
                next: NextRequest { within: self.within, poses: 3, ..self.goal.request() },
            },
        };
        let ended = depthcal_live::run(options, self.source(), |address| {
            say!("open {address}");
            if self.share {
                say!("the address has a secret: give it only to those who may capture");
            }
        });
        let ended = ended.map_err(input)?;
        say!("{}: {}", ended.folder.display(), count(ended.kept.len(), "frame"));
        if let Some(problem) = &ended.problem {
            say!("the source ended: {problem}");
        }
        self.calibrate(&ended, &request, session)
    }

    fn source(&self) -> Source {
        match self.source == Path::new("-") {
            true => Source::Stream(Box::new(std::io::stdin())),
            false => Source::Folder { path: self.source.clone(), unit_mm: self.unit_mm, is_video: self.video },
        }
    }

    /// Calibrates the dataset, as `calibrate` does.
    fn calibrate(&self, ended: &Ended, request: &FitRequest, session: &Session) -> Result<Value, Failure> {
        let Ended { folder, kept, problem } = ended;
        let mut value = json!({ "dataset": folder, "kept": kept, "source_problem": problem });
        if kept.is_empty() {
            return Ok(value);
        }
        let cross_validate = (kept.len() >= FEWEST).then_some(PARTS);
        let request = FitRequest { cross_validate, ..request.clone() };
        let busy = Progress::busy("calibrating");
        let options = LoadOptions {
            cache: default_cache(),
            register: session.register.clone(),
            progress: session.progress.clone(),
            ..LoadOptions::default()
        };
        let loaded = std::sync::Arc::new(load(folder, &options).map_err(input)?);
        let fit = request.fit(&loaded, session.calibrate_options())?;
        drop(busy);
        say!("\n{}", fit.table());
        let out = folder.join("calibration");
        save(&fit, &made(session), &out, session, || Ok(()))?;
        let written = ["calibration.json", "report.html"].map(|name| out.join(name));
        say!("written: {} and {}", written[0].display(), written[1].display());
        value["written"] = json!(written);
        Ok(value)
    }
}
