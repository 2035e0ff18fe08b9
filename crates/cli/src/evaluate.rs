//! `evaluate`: errors of a calibration on datasets.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use depthcal_formula::resolve;
use depthcal_io::Calibration;
use depthcal_model::Register;
use serde_json::{Value, json};

use super::common::{Output, Reading, calibration_path, frames_of, made, print_not_evaluated, value_of};
use super::failure::{Failure, input};
use super::recording::Recording;
use super::results::save;
use super::session::Session;
use super::transfers::print_transfers;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::load::Loaded;
use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::task::{Evaluations, GivenCamera, OptionNames, with_effects};
use depthcal_report::format::count;

/// Measures a calibration's errors on datasets, before and after correction.
///
/// Poses are estimated from the images alone, with camera and lens of the calibration fixed. Writes evaluation.json and
/// report.html.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal evaluate result/calibration.json other-captures/ --out check/
  depthcal evaluate result/calibration.json monday/ tuesday/ --out check/
  depthcal evaluate factory.yml captures/ --out check/              another program's camera
  depthcal evaluate result/calibration.json other/ --json --out check/ | jq '.datasets[].depth_rms_mm'")]
pub(super) struct Evaluate {
    /// A calibration.json, or the folder that it is in; or a camera file of another program, which corrects
    /// no depth.
    #[arg(value_parser = calibration_path())]
    pub(super) calibration: PathBuf,
    /// Folders with a dataset.toml each.
    #[arg(required = true)]
    datasets: Vec<PathBuf>,
    /// Files of formulas with a `value` of every parameter: effects that the camera is given in addition, with these values.
    #[arg(long, value_delimiter = ',', value_name = "FILE.toml,…")]
    with: Vec<String>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    recording: Recording,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Evaluate {
    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        self.with = resolve("--with", &self.with, register)?;
        Ok(())
    }

    /// The given cameras with the effects of `--with`; a camera file of another program has images of `size`, px.
    fn cameras(&self, given: &GivenCamera, size: [usize; 2], session: &Session) -> Result<Vec<PlacedCamera>, Failure> {
        let mut cameras = given.cameras(size, &session.register)?;
        if let ([camera], false) = (cameras.as_mut_slice(), self.with.is_empty()) {
            let option = OptionNames::COMMAND_LINE.with;
            camera.camera = with_effects(camera.camera.clone(), option, &self.with, &session.register)?;
        } else if !self.with.is_empty() {
            let message =
                "--with is for one camera: calibrate the rig with the effect (calibrate --with CAMERA:EFFECT)";
            return Err(Failure::Input(message.to_owned()));
        }
        Ok(cameras)
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        self.recording.check()?;
        self.output.prepare()?;
        let given = GivenCamera::read(&self.calibration)?;
        let title = self.calibration.display().to_string();
        Calibration::check_no_other_in(&self.output.out, given.record(), &title).map_err(input)?;
        let cameras = given.size().map(|size| self.cameras(&given, size, session)).transpose()?.unwrap_or_default();
        if cameras.len() > 1 {
            self.recording.refuse_for_rig()?;
        }
        let calibration = given.record().cloned().map(Arc::new);
        let mut evaluations = Evaluations { title, cameras, calibration, datasets: Vec::new() };
        let (mut captures, mut frames) = (Vec::new(), Vec::new());
        for path in &self.datasets {
            let loaded = self.reading.load(path, session)?;
            if let ([], Some(camera)) = (evaluations.cameras.as_slice(), loaded.cameras.first()) {
                // A camera file may have no size: that of the first images then holds for all.
                let size = [camera.capture.width, camera.capture.height];
                evaluations.cameras = self.cameras(&given, size, session)?;
            }
            let busy = Progress::busy("measuring");
            let missing = evaluations.add(&loaded, path, &session.progress)?;
            drop(busy);
            for name in missing {
                say!("  {name}: the dataset has no camera of this name");
            }
            let Some((evaluated, _)) = evaluations.datasets.last() else { continue };
            for (_, camera) in &evaluated.cameras {
                let known = if loaded.cameras.len() == 1 { loaded.cameras[0].capture.dropped.as_slice() } else { &[] };
                print_not_evaluated(camera, known);
                frames.push(frames_of(&camera.name, camera.frames.len(), &camera.dropped));
                let uncorrectable: usize = camera.frames.iter().map(|f| f.uncorrectable).sum();
                if uncorrectable > 0 {
                    say!(
                        "  {} cannot be corrected by this model and are excluded",
                        count(uncorrectable, "depth pixel")
                    );
                }
            }
            captures.push(loaded);
        }
        say!("\n{}", evaluations.table());
        if evaluations.fitted_name().is_some() {
            say!("* the dataset that the calibration was fitted to");
        }
        let record = evaluations.record();
        print_transfers(&record.transfer);
        let out = &self.output.out;
        let recording = || self.record(&evaluations, &captures);
        let recording = save(&evaluations, &made(session), out, session, recording)?;
        let [path, report] = ["evaluation.json", "report.html"].map(|name| out.join(name));
        say!("written: {} and {}", path.display(), report.display());
        let written: Vec<_> = [path, report].into_iter().chain(recording).collect();
        let mut value = json!({ "frames": frames, "datasets": value_of(&record.datasets)?, "written": written });
        if evaluations.cameras.len() > 1 {
            value["transfer"] = value_of(&record.transfer)?;
        }
        Ok(value)
    }

    /// Writes the recording of one camera.
    fn record(&self, evaluations: &Evaluations, captures: &[Arc<Loaded>]) -> Result<Option<PathBuf>, Failure> {
        let [camera] = evaluations.cameras.as_slice() else { return Ok(None) };
        let pairs = captures.iter().zip(&evaluations.datasets);
        let recorded = pairs.filter_map(|(l, (e, _))| Some((&l.cameras.first()?.capture, &e.cameras.first()?.1)));
        self.recording.write(&camera.camera, &recorded.collect::<Vec<_>>())
    }
}
