//! `import`: recordings as datasets.

use std::path::PathBuf;

use clap::Args;
use depthcal_import::{CameraInfo, ImportOptions, Imported, Pairing};
use depthcal_io::{DATASET_FILE, StagedDataset};
use depthcal_report::format::count;
use serde_json::{Value, json};

use super::board_file::read_board;
use super::failure::{Failure, input};
use super::progress::Progress;
use super::session::Session;
use super::voice::say;

/// Imports frames of a recording as a dataset.
///
/// Reads ROS 2 bags (MCAP, db3, or the folder of either), ROS 1 bags, Matroska files of the Azure Kinect and the Femto, and
/// folders of TUM RGB-D, Stray Scanner and Record3D. Of
/// minutes of video the frames worth having are kept: sharp, at rest, with the board, and different from each other.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal import recording.mcap --board board.toml --out captures/
  depthcal import recording.mkv --board other/dataset.toml --out captures/
  depthcal import recording.bag --image /camera/infra1/image_rect_raw --depth /camera/depth/image_rect_raw --out captures/")]
pub(super) struct Import {
    /// The recording: a file, the folder of a ROS 2 bag, or a folder of image files that another program recorded.
    recording: PathBuf,
    /// A file with a section [board], as `depthcal board` writes it, or a dataset.toml: frames that show this board are picked,
    /// and it is written to dataset.toml.
    #[arg(long, value_name = "FILE")]
    board: Option<PathBuf>,
    /// Stream of the images [default: the infrared image on the depth's pixel grid, else another image on it].
    #[arg(long, value_name = "STREAM")]
    image: Option<String>,
    /// Stream of the depth, or `none` [default: chosen by name and size].
    #[arg(long, value_name = "STREAM")]
    depth: Option<String>,
    /// Largest number of frames.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// How depth is paired with images: `time`, `order`, or seconds that are added to the depth's times where two clocks differ.
    #[arg(long, value_name = "HOW", default_value = "time", value_parser = pairing, allow_negative_numbers = true)]
    pair: Pairing,
    /// Seconds at the beginning that are left out, while the camera warms up.
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = seconds)]
    skip_s: f64,
    /// Folder for the dataset; created if it does not exist. It must not hold one already.
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

/// `--pair`.
fn pairing(text: &str) -> Result<Pairing, String> {
    match text {
        "time" => Ok(Pairing::Time),
        "order" => Ok(Pairing::Order),
        number => match number.parse() {
            Ok(offset_s) if f64::is_finite(offset_s) => Ok(Pairing::Offset(offset_s)),
            _ => Err("expected time, order, or a number of seconds".to_owned()),
        },
    }
}

/// `--skip-s`.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.0..=1e6).contains(&seconds) => Ok(seconds),
        _ => Err("expected a number of seconds from 0 on".to_owned()),
    }
}

impl Import {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let present = self.out.join("dataset.toml");
        if present.exists() {
            return Err(Failure::Input(format!(
                "{}: there is a dataset already: give --out another folder",
                present.display()
            )));
        }
        let options = ImportOptions {
            image: self.image.clone(),
            depth: self.depth.clone(),
            board: self.board.as_deref().map(read_board).transpose()?,
            frames: self.frames as usize,
            pairing: self.pair,
            skip_s: self.skip_s,
        };
        let staged = StagedDataset::within(&self.out, DATASET_FILE).map_err(input)?;
        let stage = session.progress.stage("import");
        let busy = Progress::busy("importing");
        let imported = depthcal_import::import(&self.recording, &staged.folder(), &options).map_err(|error| {
            // Errors name the place where files will be in the end.
            let [hidden, out] = [staged.folder(), self.out.clone()].map(|path| path.display().to_string());
            Failure::Input(error.to_string().replace(&hidden, &out))
        })?;
        drop((busy, stage));
        let hidden = staged.folder();
        staged.commit().map_err(input)?;
        let written = imported
            .written
            .iter()
            .map(|path| path.strip_prefix(&hidden).map_or(path.clone(), |name| self.out.join(name)));
        let written: Vec<PathBuf> = written.collect();
        self.print(&imported, options.board.is_some());
        let mut told = imported.to_json();
        told["written"] = json!(written);
        Ok(told)
    }

    fn print(&self, imported: &Imported, has_board: bool) {
        let Imported { frames, of_images, searched, image, depth, streams, without_depth, .. } = imported;
        for path in &imported.cut {
            say!("{} is cut off: read up to its last complete message", path.display());
        }
        for (stream, [width, height]) in streams {
            say!("  {} ({}, {width} × {height} px)", stream.name, stream.kind);
        }
        let how = |given: bool| if given { "" } else { " (chosen; --image and --depth name others)" };
        say!("image: {}{}", image.name, how(self.image.is_some()));
        match (depth, imported.unit_mm) {
            (Some(depth), Some(unit_mm)) => {
                say!("depth: {} in units of {unit_mm} mm{}", depth.name, how(self.depth.is_some()));
            }
            _ => say!("depth: none"),
        }
        if imported.is_rig {
            say!(
                "image and depth are of different size or intrinsics: declared as two cameras of a rig, image and depth"
            );
            if imported.has_extrinsics {
                say!("the recording states the place of the depth sensor: calibrations are held against it");
            }
        }
        match self.pair {
            Pairing::Order if depth.is_some() => say!("depth is paired with images by their order, as asked"),
            Pairing::Offset(offset_s) if depth.is_some() => {
                say!("depth is paired with images after {offset_s} s were added to its times, as asked");
            }
            _ => {}
        }
        if self.skip_s > 0.0 {
            say!("the first {} s are left out, as asked", self.skip_s);
        }
        if let Some((looked_at, with_board)) = searched {
            say!("the board was found in {with_board} of the {looked_at} sharpest images");
        }
        print_start(imported.camera.as_ref(), "");
        if imported.is_rig {
            print_start(imported.depth_camera.as_ref(), " of depth");
        }
        if *without_depth > 0 {
            say!("{} not written: no depth near in time", count(*without_depth, "image"));
        }
        say!("{} of {}, different from each other", count(*frames, "frame"), count(*of_images, "image"));
        if !has_board {
            say!("describe the board in {}", self.out.join("dataset.toml").display());
        }
        say!("written: {}", self.out.display());
    }
}

/// Says from which intrinsics a calibration starts.
fn print_start(camera: Option<&CameraInfo>, whose: &str) {
    match camera {
        Some(camera) => {
            let [fx, fy, cx, cy] = camera.pinhole;
            let model = if camera.model.is_empty() { "no lens model" } else { &camera.model };
            say!("start values{whose}: f {fx:.1}, {fy:.1} px, c {cx:.1}, {cy:.1} px ({model})");
        }
        None => say!("start values{whose}: none in the recording"),
    }
}
