//! `export`: calibrations for other programs.

use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_io::{CameraFormat, ExportCamera, write_atomically};

use serde_json::{Value, json};

use super::common::{calibration_path, read_calibration};
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
    /// A calibration.json, or the folder that it is in.
    #[arg(value_parser = calibration_path())]
    calibration: PathBuf,
    /// OpenCV YAML, ROS camera_info, Kalibr camchain, mrcal .cameramodel, or COLMAP cameras.txt.
    #[arg(long, value_parser = CameraFormat::ALL.map(CameraFormat::name))]
    format: String,
    /// File to write [default: in depthcal-out/export, named as is usual in the format].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
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
        let out = self.out.clone().unwrap_or_else(|| Path::new("depthcal-out/export").join(default_name(format)));
        write_atomically(&out, |writer| writer.write_all(export.text.as_bytes())).map_err(input)?;
        say!("written: {}", out.display());
        let warnings: Vec<String> = export.warnings.iter().map(ToString::to_string).collect();
        Ok(json!({ "warnings": warnings, "written": [out] }))
    }
}

/// Name of the file of a format where none is given.
fn default_name(format: CameraFormat) -> &'static str {
    match format {
        CameraFormat::OpenCv => "camera.yml",
        CameraFormat::Ros => "camera_info.yaml",
        CameraFormat::Kalibr => "camchain.yaml",
        CameraFormat::Mrcal => "camera.cameramodel",
        CameraFormat::Colmap => "cameras.txt",
    }
}
