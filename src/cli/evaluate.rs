use std::path::PathBuf;

use clap::Args;
use depthcal_io::Evaluation;
use depthcal_model::Register;

use super::common::{Failure, Output, Reading, command_line, input, read_calibration, write_report};
use crate::evaluate::{evaluate, table};
use crate::report::{ReportDataset, ReportInput, Role};

/// Measures a calibration's errors on datasets, before and after correction.
///
/// Poses come from the images alone, with the calibration's camera and lens held.
#[derive(Debug, Args)]
pub(super) struct Evaluate {
    /// A calibration.json.
    calibration: PathBuf,
    /// Folders with a dataset.toml each.
    #[arg(required = true)]
    datasets: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    output: Output,
}

impl Evaluate {
    pub(super) fn run(&self) -> Result<(), Failure> {
        let (calibration, camera) = read_calibration(&self.calibration, &Register::builtin())?;
        let (mut datasets, mut all) = (Vec::new(), Vec::new());
        let mut fitted = None;
        for path in &self.datasets {
            let loaded = self.reading.load(path)?;
            let size = (loaded.capture.width, loaded.capture.height);
            if size != (camera.width, camera.height) {
                return Err(Failure::Input(format!(
                    "{}: its images are {} × {} px, but the calibration is for {} × {} px",
                    path.display(),
                    size.0,
                    size.1,
                    camera.width,
                    camera.height
                )));
            }
            let role = if loaded.reference.digest == calibration.dataset.digest {
                fitted = Some(loaded.capture.name.clone());
                Role::Fitted
            } else {
                Role::Other
            };
            let evaluated = evaluate(&camera, &loaded.capture);
            let uncorrectable: usize = evaluated.frames.iter().map(|f| f.uncorrectable).sum();
            if uncorrectable > 0 {
                println!("  {uncorrectable} depth pixels cannot be corrected by this model and are left out");
            }
            datasets.push(evaluated.record());
            all.push((evaluated, role));
        }
        println!("\n{}", table(&datasets, fitted.as_deref()));
        if fitted.is_some() {
            println!("* the dataset that the calibration was fitted to");
        }
        let path = self.output.file("evaluation.json");
        Evaluation { datasets }.write(&path).map_err(input)?;
        let shown: Vec<ReportDataset<'_>> =
            all.iter().map(|(evaluated, role)| ReportDataset { evaluated, role: *role }).collect();
        let report = ReportInput {
            title: format!("Evaluation of {}", self.calibration.display()),
            command_line: command_line(),
            calibrated: None,
            evaluations: &shown,
            story: &[],
        };
        let report = write_report(&report, &self.output.out)?;
        println!("written: {} and {}", path.display(), report.display());
        Ok(())
    }
}
