//! `export`: calibrations and camera files for other programs.

use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_calibration::task::GivenCamera;
use depthcal_io::{CameraFormat, ExportCamera, write_atomically};

use serde_json::{Value, json};

use super::common::{calibration_path, read_calibration};
use super::failure::{Failure, input};
use super::session::Session;
use super::voice::{complaint, say};

/// Writes a calibration, or a camera file of another program, in the format of another program.
///
/// Where a format cannot hold the lens, the nearest that it can is written. Warns on standard error of everything that the format
/// cannot represent, with the largest error in pixels.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal export result/calibration.json --format opencv --out camera.yml
  depthcal export result/calibration.json --format ros --out camera_info.yaml
  depthcal export camchain.yaml#cam0 --format colmap --out cameras.txt
  depthcal export factory_calibration.json#colour-1920x1080 --format opencv")]
pub(super) struct Export {
    /// A calibration.json, the folder that it is in, or a camera file of another program; FILE#NAME for one of several cameras.
    #[arg(value_name = "FILE", value_parser = calibration_path())]
    camera: PathBuf,
    /// Format to write; docs/lenses.md says what each holds.
    #[arg(long, value_parser = CameraFormat::ALL.map(CameraFormat::name))]
    format: String,
    /// Size of the images in px, such as 640x480, of a camera file that has none.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size_px)]
    size: Option<[usize; 2]>,
    /// File to write [default: in depthcal-out/export, named as is usual in the format].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl Export {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let format: CameraFormat = self.format.parse().map_err(input)?;
        let in_file = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", self.camera.display()));
        let camera = self.camera(session)?;
        let export = camera.export(format).map_err(|error| in_file(&error))?;
        for warning in &export.warnings {
            complaint("warning", 0, warning);
        }
        let out = self.out.clone().unwrap_or_else(|| Path::new("depthcal-out/export").join(format.file_name()));
        write_atomically(&out, |writer| writer.write_all(export.text.as_bytes())).map_err(input)?;
        say!("written: {}", out.display());
        let warnings: Vec<String> = export.warnings.iter().map(ToString::to_string).collect();
        Ok(json!({ "warnings": warnings, "written": [out] }))
    }

    /// The camera of the file that is given.
    fn camera(&self, session: &Session) -> Result<ExportCamera, Failure> {
        let in_file = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", self.camera.display()));
        let GivenCamera::Intrinsics(_, intrinsics) = GivenCamera::read(&self.camera)? else {
            let (calibration, camera) = read_calibration(&self.camera, &session.register)?;
            return Ok(ExportCamera::new(&camera, &calibration));
        };
        let size = match (intrinsics.size, self.size) {
            (Some(size), None) => size,
            (None, Some(size)) => size,
            (Some(size), Some(given)) if size == given => size,
            (Some([width, height]), Some(_)) => {
                return Err(in_file(&format!("has images of {width}x{height} px: leave --size out")));
            }
            (None, None) => {
                return Err(in_file(&"does not say how large the images are: give --size, such as --size 640x480"));
            }
        };
        let camera = intrinsics.camera(size, &session.register).map_err(|error| in_file(&error))?;
        Ok(ExportCamera { camera, depth: Vec::new() })
    }
}

/// Width and height, px, of words such as `640x480`.
pub(super) fn size_px(text: &str) -> Result<[usize; 2], String> {
    let side = |word: &str| word.trim().parse::<usize>().ok().filter(|side| (1..=1 << 16).contains(side));
    let size = text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
    size.ok_or_else(|| "give width and height in px, such as 640x480".to_owned())
}
