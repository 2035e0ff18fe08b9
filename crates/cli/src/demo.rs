//! `demo`: simulates captures and diagnoses them.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_simulate::{CameraTruth, Effect, Kind, Simulation};

use serde_json::Value;

use super::common::{Reading, made};
use super::diagnosis_output::tell;
use super::failure::{Failure, input};
use super::session::Session;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::task::{DiagnoseRequest, Made, ModelRequest, OptionNames};

/// The effect that the demo's camera has and the declared model lacks.
const EFFECT: &str = "cyclic_depth";
/// Its size, mm: the amplitude of the wave, a part of which D compensates.
const SIZE_MM: f64 = 6.0;
const SEED: u64 = 1;
/// Marks a folder as made by an earlier demo, so that it may be replaced.
const MARK: &str = ".made-by-depthcal-demo";

/// Simulates captures of a camera with an undeclared error, finds the error, and writes the report.
///
/// Two captures are rendered: one to fit, one to evaluate the result. The camera is camera 1 of Sjöholm 2017 with depth that
/// also waves over distance, which the usual model lacks; `diagnose` finds it from the captures.
#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder for captures and results.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
}

impl Demo {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let captures = self.out.join("captures");
        clear(&captures)?;
        let (fitted, other) = (captures.join("general1"), captures.join("general2"));
        say!("rendering two captures of a camera with {EFFECT}, which the declared model lacks");
        render(&fitted, Kind::General(1), session)?;
        render(&other, Kind::General(2), session)?;

        let reading = Reading { refresh: false, no_cache: true, markers: None, image_memory: 1024 };
        let (loaded, judge) = (reading.load(&fitted, session)?, reading.load(&other, session)?);
        let names = OptionNames::COMMAND_LINE;
        let model = ModelRequest { names, model: "projective".to_owned(), with: Vec::new(), lens: None };
        let request = DiagnoseRequest { model, folds: 5, formulas: true };
        let mut diagnosed = request.diagnose(&loaded, Some(&judge), session.calibrate_options())?;
        for (_, camera) in &mut diagnosed.cameras {
            camera.title = "Demo: a depth camera with an undeclared error".to_owned();
            camera.story = story();
        }
        let made = Made { command_line: "depthcal demo".to_owned(), ..made(session) };
        tell(&diagnosed, &made, &self.out, session, || Ok(None))
    }
}

fn story() -> Vec<String> {
    vec![format!(
        "The captures were simulated: camera 1 of Sjöholm 2017 with its published lens and depth distortion, and the effect \
         '{EFFECT}'. Neither the dataset nor the declared model ('projective') contains this effect. One capture (general1) \
         was fitted; the other (general2) was used for evaluation only."
    )]
}

fn render(folder: &Path, kind: Kind, session: &Session) -> Result<(), Failure> {
    let camera = CameraTruth::published(1).map_err(input)?;
    let effect = Effect::new(EFFECT, SIZE_MM).map_err(input)?;
    let _busy = Progress::busy("rendering");
    let _stage = session.progress.stage("rendering");
    Simulation::new(camera, kind, &[effect], SEED).write_dataset(folder).map_err(input)?;
    Ok(())
}

/// Removes the captures of an earlier demo; refuses any other folder.
fn clear(captures: &Path) -> Result<(), Failure> {
    let unwritable = |e: std::io::Error| Failure::Input(format!("{}: cannot write here: {e}", captures.display()));
    let is_empty = |folder: &Path| fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if captures.exists() {
        // A demo that was killed may have left the folder without anything in it.
        if !captures.join(MARK).exists() && !is_empty(captures) {
            let shown = captures.display();
            return Err(Failure::Input(format!(
                "{shown} exists and was not made by an earlier demo: give another --out"
            )));
        }
        // The mark stays to the end, so that a demo that is killed here leaves a folder that the next one may clear.
        for entry in fs::read_dir(captures).map_err(unwritable)? {
            let entry = entry.map_err(unwritable)?;
            if entry.file_name() != MARK {
                let path = entry.path();
                if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.map_err(unwritable)?;
            }
        }
    }
    fs::create_dir_all(captures).map_err(unwritable)?;
    fs::write(captures.join(MARK), "").map_err(unwritable)
}
