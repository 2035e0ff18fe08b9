//! `export`: calibrations for other programs.

use std::path::PathBuf;

use clap::Args;
use depthcal_io::{CameraFormat, ExportCamera, write_atomically};

use serde_json::{Value, json};

use super::common::read_calibration;
use super::failure::{Failure, input};
use super::session::Session;
use super::voice::{complaint, say};

/// Writes a calibration in the format of another program.
///
/// Where a format cannot hold the lens, the nearest that it can is written. Warns on standard error of everything that the format
/// cannot represent, with the largest error in pixels.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal export result/calibration.json --format opencv --out camera.yml
  depthcal export result/calibration.json --format ros --out camera_info.yaml")]
pub(super) struct Export {
    /// A calibration.json.
    calibration: PathBuf,
    /// OpenCV YAML, ROS camera_info, Kalibr camchain, mrcal .cameramodel, or COLMAP cameras.txt.
    #[arg(long, value_parser = CameraFormat::ALL.map(CameraFormat::name))]
    format: String,
    /// File to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Export {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let format: CameraFormat = self.format.parse().map_err(input)?;
        let (calibration, camera) = read_calibration(&self.calibration, &session.register)?;
        let of_file = |error| Failure::Input(format!("{}: {error}", self.calibration.display()));
        let export = ExportCamera::new(&camera, &calibration).export(format).map_err(of_file)?;
        for warning in &export.warnings {
            complaint("warning", 0, warning);
        }
        write_atomically(&self.out, |writer| writer.write_all(export.text.as_bytes())).map_err(input)?;
        say!("written: {}", self.out.display());
        let warnings: Vec<String> = export.warnings.iter().map(ToString::to_string).collect();
        Ok(json!({ "warnings": warnings, "written": [self.out] }))
    }
}
