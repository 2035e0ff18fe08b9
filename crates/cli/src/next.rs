//! `next`: which captures to add.

use std::path::PathBuf;

use clap::Args;
use depthcal_calibration::calibrate::CameraFit;
use depthcal_calibration::task::{Fit, NextCaptures, NextRequest};
use depthcal_io::write_atomically;
use depthcal_report::format::{count, quantity};
use depthcal_report::{board_views, goal_words, next_value};
use serde_json::Value;

use super::common::{Reading, above_zero, camera_count};
use super::failure::{Failure, input};
use super::goal_options::GoalOptions;
use super::model_options::ModelOptions;
use super::progress::Progress;
use super::session::Session;
use super::voice::say;

/// Says which captures to add: the poses of the board that lower an uncertainty most, and how many frames like these are enough.
///
/// Fits the dataset as `calibrate` does. What every pose of a grid over distance, place in the image and tilt would add follows
/// from the fitted camera; it does not depend on what will be measured.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal next captures/                                   corrected depth over the distances that were seen
  depthcal next captures/ --range-mm 500,4000 --within 2    … over these, until its error is below 2 mm
  depthcal next captures/ --goal projection --within 0.05   pixels
  depthcal next captures/ --goal pinhole.fx                 one parameter
  depthcal next captures/ --svg next.svg                    a drawing of the boards in the camera's view")]
pub(super) struct Next {
    /// Folder with a dataset.toml.
    pub(super) dataset: PathBuf,
    #[command(flatten)]
    goal: GoalOptions,
    /// Error that is small enough, root mean square in mm, px or the parameter's unit [default: a third of a depth pixel's
    /// noise, 0.1 px, half of the present error].
    #[arg(long, value_name = "X")]
    within: Option<f64>,
    /// Number of poses.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=50))]
    frames: u16,
    /// The camera of a rig [default: the first with depth].
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Draws the boards in the camera's view into this file.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    pub(super) model: ModelOptions,
    #[command(flatten)]
    reading: Reading,
}

impl Next {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        above_zero("--within", self.within, "an error above 0, such as 1")?;
        let request = self.model.request();
        camera_count(&self.dataset, |cameras| request.check(cameras, &session.register))?;
        let loaded = self.reading.load(&self.dataset, session)?;
        let busy = Progress::busy("fitting");
        let fit = request.fit(&loaded, session.calibrate_options())?;
        drop(busy);
        let next = NextRequest {
            within: self.within,
            poses: usize::from(self.frames),
            camera: self.camera.clone(),
            ..self.goal.request()
        };
        let next = next.next(&fit.fitted)?;
        print(&next, fit.fitted.cameras.len() > 1);
        if let Some(path) = &self.svg {
            let svg = drawing(&fit, &next);
            write_atomically(path, |writer| writer.write_all(svg.as_bytes())).map_err(input)?;
            say!("written: {}", path.display());
        }
        Ok(next_value(&next))
    }
}

fn print(next: &NextCaptures, is_rig: bool) {
    let (plan, unit) = (&next.plan, next.unit.as_str());
    let of_camera = if is_rig { format!("{}: ", next.camera) } else { String::new() };
    say!(
        "{of_camera}{}: {} expected now, below {} with 95 % certainty",
        goal_words(&next.goal),
        quantity(plan.now, unit),
        quantity(plan.now_certain, unit)
    );
    let target = quantity(next.target, unit);
    match plan.frames_needed {
        Some(0) => say!("it is within {target} with 95 % certainty already: further frames are not needed"),
        Some(frames) => say!("within {target} with 95 % certainty after {} like these", count(frames, "frame")),
        None => say!(
            "frames like these do not bring it within {target}: {} is what is left when they hardly help any more",
            quantity(plan.reachable, unit)
        ),
    }
    say!("\ncapture next:");
    for (number, planned) in plan.poses.iter().enumerate() {
        say!("  {}. {}  → {}", number + 1, planned.frame.words(), quantity(planned.expected, unit));
    }
    if let Some(noise_mm) = next.noise_mm.filter(|_| unit == "mm") {
        say!(
            "\nThese are errors that all frames have in common, as far as the model is right. A single pixel has noise of {} besides, \
             which no further frame lowers.",
            quantity(noise_mm, "mm")
        );
    }
}

fn drawing(fit: &Fit, next: &NextCaptures) -> String {
    let Some(CameraFit { camera_from_rig, calibrated, .. }) = fit.fitted.cameras.get(next.number) else {
        return String::new();
    };
    let boards: Vec<_> =
        next.plan.poses.iter().map(|p| (camera_from_rig * p.rig_from_board, p.frame.words())).collect();
    board_views(&calibrated.camera, &calibrated.capture.target, &boards)
}
