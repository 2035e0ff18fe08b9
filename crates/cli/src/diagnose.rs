//! `diagnose`: finds what a model lacks.

use std::path::PathBuf;

use clap::Args;
use serde_json::Value;

use super::common::{Output, Reading, camera_count, made};
use super::diagnosis_output::tell;
use super::failure::Failure;
use super::model_options::ModelOptions;
use super::recording::Recording;
use super::session::Session;
use depthcal_calibration::load::Loaded;
use depthcal_calibration::task::{DiagnoseRequest, Diagnosed};

/// Finds effects that a camera's model lacks: fits it, tests the residuals for each known effect, adds the one that explains
/// them, fits again, and reports held-out errors before and after.
///
/// Where nothing is missing, it reports the smallest effects that these captures would have shown. Writes diagnosis.json (the
/// record), calibration.json (the last model), evaluation.json, observations.json, scores.json (for fleets) and report.html. Of a
/// rig of several cameras, each with depth is examined, with these files in a folder of its name, and the rig is adjusted again.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal diagnose captures/ --out result/                  start from K, lens and projective D
  depthcal diagnose captures/ --verify other/ --out result/  errors on another capture of the same camera
  depthcal diagnose captures/ --with reflectivity_bias --out result/
  depthcal diagnose captures/ --json --out result/ | jq .diagnosis.verdict")]
pub(super) struct Diagnose {
    /// Folder with a dataset.toml.
    dataset: PathBuf,
    /// Another dataset of the same camera, on which the errors are reported [default: cross-validation].
    #[arg(long, value_name = "DATASET")]
    verify: Option<PathBuf>,
    #[command(flatten)]
    pub(super) model: ModelOptions,
    /// Parts of the cross-validation, without --verify.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(2..))]
    folds: u16,
    /// Does not search formulas for what the known effects leave unexplained.
    #[arg(long)]
    no_discovery: bool,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    recording: Recording,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Diagnose {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let request =
            DiagnoseRequest { model: self.model.model(), folds: usize::from(self.folds), formulas: !self.no_discovery };
        let cameras = camera_count(&self.dataset, |cameras| request.check(cameras, &session.register))?;
        if cameras > 1 {
            self.recording.refuse_for_rig()?;
        }
        self.recording.check()?;
        self.output.prepare()?;
        let loaded = self.reading.load(&self.dataset, session)?;
        let verify = self.verify.as_ref().map(|path| self.reading.load(path, session)).transpose()?;
        let diagnosed = request.diagnose(&loaded, verify.as_deref(), session.calibrate_options())?;
        let record = || self.record(&diagnosed, verify.as_deref());
        tell(&diagnosed, &made(session), &self.output.out, session, record)
    }

    /// Writes the recording of one camera; held-out frames of the dataset itself were evaluated with several cameras.
    fn record(&self, diagnosed: &Diagnosed, verify: Option<&Loaded>) -> Result<Option<PathBuf>, Failure> {
        let Some(camera) = diagnosed.only_camera() else { return Ok(None) };
        let (last, after) = (&camera.diagnosis.last, &*camera.diagnosis.after.evaluated);
        let detected = last.capture.detected();
        let mut recorded = vec![(&detected, &camera.on_fitted)];
        recorded.extend(verify.and_then(|v| v.cameras.first()).map(|v| (&v.capture, after)));
        self.recording.write(&last.camera, &recorded)
    }
}
