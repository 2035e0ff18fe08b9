//! `diff`: two calibrations compared with each other.

use std::path::PathBuf;

use clap::Args;
use depthcal_calibration::task::{DiffSide, Differed, GivenCamera};
use depthcal_report::{difference_sentences, difference_text};
use serde_json::{Value, json};

use super::common::{Output, calibration_path, made, value_of};
use super::export::size_px;
use super::failure::Failure;
use super::results::save;
use super::session::Session;
use super::voice::say;

/// Compares two calibrations of a camera with each other: yesterday's, the maker's, another model's.
///
/// Differences of projection (px, with the best rotation of the rays removed) and of corrected depth (mm) over image and
/// distance, against the uncertainties of both. Writes diff.json and report.html.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal diff monday/calibration.json today/calibration.json     has the camera changed?
  depthcal diff factory.yml result/calibration.json                is the maker's file right?
  depthcal diff result-projective/ result-bspline/ --out diff/     does the model matter?
  depthcal diff a/ b/ --json | jq '.verdict'")]
pub(super) struct Diff {
    /// A calibration.json, the folder that it is in, or a camera file of another program.
    #[arg(value_parser = calibration_path())]
    first: PathBuf,
    /// Another one; differences are this one minus the first.
    #[arg(value_parser = calibration_path())]
    pub(super) second: PathBuf,
    /// Size of the images in px, such as 640x480, where neither file has it.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size_px)]
    size: Option<[usize; 2]>,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Diff {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        self.output.prepare()?;
        let side = |path: &PathBuf| -> Result<DiffSide, Failure> {
            let given = GivenCamera::read(path)?;
            Ok(DiffSide { name: path.display().to_string(), given, register: session.register.clone() })
        };
        let sides = [side(&self.first)?, side(&self.second)?];
        let stage = session.progress.stage("comparing");
        let differed = Differed::new(&sides, self.size, "--size")?;
        drop(stage);
        say!("{}", difference_text(&differed.record));
        save(&differed, &made(session), &self.output.out, session, || Ok(()))?;
        let [file, report] = ["diff.json", "report.html"].map(|name| self.output.out.join(name));
        say!("written: {} and {}", file.display(), report.display());
        Ok(json!({
            "verdict": difference_sentences(&differed.record),
            "difference": value_of(&differed.record)?,
            "written": [file, report],
        }))
    }
}
