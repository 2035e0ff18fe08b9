//! `export`: calibrations for other programs.

use std::path::PathBuf;

use clap::Args;
use depthcal_io::{Calibration, ExportCamera, ExportFormat, write_atomically};

use serde_json::{Value, json};

use super::failure::{Failure, input};
use super::voice::{complaint, say};

/// Writes a calibration in the format of another program.
///
/// Warns on standard error of everything that the format cannot represent.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal export result/calibration.json --format opencv --out camera.yml
  depthcal export result/calibration.json --format ros --out camera_info.yaml")]
pub(super) struct Export {
    /// A calibration.json.
    calibration: PathBuf,
    /// OpenCV YAML, ROS camera_info, Kalibr camchain, or mrcal .cameramodel.
    #[arg(long, value_parser = ["opencv", "ros", "kalibr", "mrcal"])]
    format: String,
    /// File to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Export {
    pub(super) fn run(&self) -> Result<Value, Failure> {
        let format: ExportFormat = self.format.parse().map_err(input)?;
        let calibration = Calibration::read(&self.calibration).map_err(input)?;
        let of_file = |error| Failure::Input(format!("{}: {error}", self.calibration.display()));
        let export = ExportCamera::from_calibration(&calibration).and_then(|c| c.export(format)).map_err(of_file)?;
        for warning in &export.warnings {
            complaint("warning", 0, warning);
        }
        write_atomically(&self.out, |writer| writer.write_all(export.text.as_bytes())).map_err(input)?;
        say!("written: {}", self.out.display());
        let warnings: Vec<String> = export.warnings.iter().map(ToString::to_string).collect();
        Ok(json!({ "warnings": warnings, "written": [self.out] }))
    }
}
