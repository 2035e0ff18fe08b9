//! `detect`: finds the board in the images of a dataset.

use std::path::PathBuf;

use clap::Args;

use serde_json::{Value, json};

use super::common::{Reading, frames_of};
use super::failure::{Failure, input};
use super::session::Session;
use super::voice::say;
use depthcal_calibration::load::LoadedCamera;
use depthcal_report::format::count;

/// Finds the board in every image of a dataset and caches what was found.
///
/// Prints why the board was not found, for every image without it. The other commands detect boards themselves.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal detect captures/
  depthcal detect captures/ --refresh --out found/    detect again, and write observations.json")]
pub(super) struct Detect {
    /// Folder with a dataset.toml.
    pub(super) dataset: PathBuf,
    /// Folder that receives observations.json.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

impl Detect {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let loaded = self.reading.load(&self.dataset, session)?;
        let mut values = Vec::new();
        for camera in &loaded.cameras {
            let out = self
                .out
                .as_ref()
                .map(|out| if loaded.cameras.len() > 1 { out.join(camera.name()) } else { out.clone() });
            values.push(self.tell(camera, out)?);
        }
        Ok(match values.len() {
            1 => values.remove(0),
            _ => json!({ "cameras": values }),
        })
    }

    /// Prints what was found in the images of a camera, and writes it into a folder where one is given.
    fn tell(&self, camera: &LoadedCamera, out: Option<PathBuf>) -> Result<Value, Failure> {
        let capture = &camera.capture;
        let markers: usize = capture.frames.iter().map(|f| f.markers.len()).sum();
        say!("{}", count(markers, "marker"));
        if let Some(measured) = camera.circle_diameter.filter(|m| m.declared_mm.is_some()) {
            say!("{measured}");
        }
        if let Some(out) = out {
            camera.observations().write(out.join("observations.json")).map_err(input)?;
        }
        let frames = frames_of(&capture.name, capture.frames.len(), &capture.dropped);
        let diameter = camera.circle_diameter.map(
            |m| json!({ "measured": m.diameter_mm, "std": m.std_mm, "declared": m.declared_mm, "frames": m.frames }),
        );
        let layout = camera.charuco_layout.map(|layout| layout.name());
        Ok(json!({ "frames": frames, "markers": markers, "circle_diameter_mm": diameter, "charuco_layout": layout }))
    }
}
