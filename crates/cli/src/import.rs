//! `import`: recordings as datasets.

use std::path::PathBuf;

use clap::Args;
use depthcal_import::{ImportOptions, Imported};
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
/// Reads ROS 2 bags (MCAP, db3), ROS 1 bags, and Matroska files of the Azure Kinect and the Femto. Of minutes of video the frames
/// worth having are kept: sharp, at rest, with the board, and different from each other.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal import recording.mcap --board board.toml --out captures/
  depthcal import recording.mkv --board other/dataset.toml --out captures/
  depthcal import recording.bag --image /camera/infra1/image_rect_raw --depth /camera/depth/image_rect_raw --out captures/")]
pub(super) struct Import {
    /// The recording.
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
    /// Folder for the dataset; created if it does not exist. It must not hold one already.
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
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
        let streams: Vec<Value> = imported
            .streams
            .iter()
            .map(|(stream, size)| json!({ "name": stream.name, "type": stream.kind, "width": size[0], "height": size[1] }))
            .collect();
        Ok(json!({
            "frames": imported.frames,
            "of_images": imported.of_images,
            "searched": imported.searched.map(|s| s.0),
            "with_board": imported.searched.map(|s| s.1),
            "without_depth": imported.without_depth,
            "image": imported.image.name,
            "depth": imported.depth.as_ref().map(|stream| &stream.name),
            "streams": streams,
            "written": written,
        }))
    }

    fn print(&self, imported: &Imported, has_board: bool) {
        let Imported { frames, of_images, searched, image, depth, streams, camera, without_depth, .. } = imported;
        for (stream, [width, height]) in streams {
            say!("  {} ({}, {width} × {height} px)", stream.name, stream.kind);
        }
        let how = |given: bool| if given { "" } else { " (chosen; --image and --depth name others)" };
        say!("image: {}{}", image.name, how(self.image.is_some()));
        match depth {
            Some(depth) => say!("depth: {}{}", depth.name, how(self.depth.is_some())),
            None => say!("depth: none on the pixel grid of {}", image.name),
        }
        if let Some((looked_at, with_board)) = searched {
            say!("the board was found in {with_board} of the {looked_at} sharpest images");
        }
        match camera {
            Some(camera) => {
                let [fx, fy, cx, cy] = camera.pinhole;
                say!("start values: f {fx:.1}, {fy:.1} px, c {cx:.1}, {cy:.1} px ({})", camera.model);
                if camera.brown_conrady().is_none() {
                    say!("  [camera] leaves its distortion out; camera_info.yaml has all of it");
                }
            }
            None => say!("start values: none for this image in the recording"),
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
