use std::path::PathBuf;

use clap::Args;

use super::common::{Failure, Output, Reading, command_line, input, write_calibration, write_report};
use crate::calibrate::CalibrateOptions;
use crate::capture::declared_camera;
use crate::diagnose::account::{story, text, to_file};
use crate::diagnose::{DiagnoseError, DiagnoseOptions, diagnose};
use crate::evaluate::evaluate;
use crate::report::{ReportDataset, ReportInput, Role};

/// Finds what a camera's model lacks: fits it, looks at what is left, traces that to an effect, adds it, fits again and
/// reports the error before and after on frames that the fit did not see.
///
/// Nothing to find is a verdict too, given with the smallest effects that the captures would have shown.
#[derive(Debug, Args)]
pub(super) struct Diagnose {
    /// Folder with a dataset.toml.
    dataset: PathBuf,
    /// Another dataset of the same camera, on which the errors are reported; without it every frame is judged by a fit
    /// that did not see it.
    #[arg(long, value_name = "DATASET")]
    verify: Option<PathBuf>,
    /// Depth model to start from: none, projective, projective:xw, or a stack such as projective+cyclic_depth.
    #[arg(long, default_value = "projective")]
    model: String,
    /// Effects that the model is to have from the start.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// Lens model.
    #[arg(long, default_value = "brown-conrady", value_parser = ["brown-conrady", "none"])]
    lens: String,
    /// Fits per cross-validation where --verify is not given.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(2..))]
    folds: u16,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    output: Output,
}

impl From<DiagnoseError> for Failure {
    fn from(error: DiagnoseError) -> Self {
        match error {
            DiagnoseError::Calibrate(error) => error.into(),
            DiagnoseError::Score(error) => Failure::Untrusted(error.to_string()),
            DiagnoseError::NoDepth { .. } => Failure::Input(error.to_string()),
        }
    }
}

impl Diagnose {
    pub(super) fn run(&self) -> Result<(), Failure> {
        let mut options = CalibrateOptions {
            model: self.model.clone(),
            effects: self.with.clone(),
            lens: self.lens.clone(),
            ..CalibrateOptions::default()
        };
        options.check_names().map_err(input)?;
        let loaded = self.reading.load(&self.dataset)?;
        let verify = self.verify.as_ref().map(|path| self.reading.load(path)).transpose()?;
        options.camera =
            declared_camera(&loaded.dataset, loaded.capture.width, loaded.capture.height, &options.register);
        let options = DiagnoseOptions { calibrate: options, folds: usize::from(self.folds) };
        let d = diagnose(&loaded.capture, verify.as_ref().map(|v| &v.capture), &options)?;
        let account = text(&d);
        println!("\n{account}");
        let file = self.output.file("diagnosis.json");
        to_file(&d, loaded.reference.clone(), &self.model).write(&file).map_err(input)?;
        let fitted = evaluate(&d.last.camera, &d.last.capture);
        let mut held_out = d.after.evaluated.record();
        held_out.name = format!("{} (held out)", held_out.name);
        write_calibration(&d.last, &fitted, &loaded, vec![fitted.record(), held_out], &self.output.out)?;
        let role = if verify.is_some() { Role::Other } else { Role::HeldOut };
        let shown = [
            ReportDataset { evaluated: &fitted, role: Role::Fitted },
            ReportDataset { evaluated: &d.after.evaluated, role },
        ];
        let story = story(&d);
        let report = ReportInput {
            title: loaded.capture.name.clone(),
            command_line: command_line(),
            calibrated: Some(&d.last),
            evaluations: &shown,
            story: &story,
        };
        let report = write_report(&report, &self.output.out)?;
        println!("written: {} and {}", file.display(), report.display());
        Ok(())
    }
}
