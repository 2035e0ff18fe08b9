//! `evaluate`: errors of a calibration on datasets.

use std::path::PathBuf;

use clap::Args;
use depthcal_io::{Calibration, Evaluation, RigDataset};
use depthcal_model::{Camera, Register};

use serde_json::{Value, json};

use super::common::{Output, Reading, command_line, frames_of, print_not_evaluated, value_of};
use super::failure::{Failure, input};
use super::formula_files;
use super::given_camera::GivenCamera;
use super::recording::Recording;
use super::results::Results;
use super::rig::{self, RigEvaluate};
use super::session::Session;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::task::{OptionNames, with_effects};
use depthcal_report::format::count;
use depthcal_report::{ReportDataset, ReportInput, Role};

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
    /// A calibration.json; or a camera file of OpenCV, ROS, Kalibr, mrcal or COLMAP, which corrects no depth.
    calibration: PathBuf,
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
        self.with = formula_files::resolve("--with", &self.with, register)?;
        Ok(())
    }

    /// The given camera with the effects of `--with`.
    fn camera(&self, given: &GivenCamera, size: [usize; 2], session: &Session) -> Result<Camera, Failure> {
        let camera = given.camera(size, &session.register)?;
        Ok(with_effects(camera, OptionNames::COMMAND_LINE.with, &self.with, &session.register)?)
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        self.recording.check()?;
        self.output.check()?;
        let given = GivenCamera::read(&self.calibration, &session.register)?;
        let name = self.calibration.display().to_string();
        Calibration::check_no_other_in(&self.output.out, given.record(), &name).map_err(input)?;
        if let GivenCamera::Calibration(record, _) = &given
            && !record.cameras.is_empty()
            && self.datasets.iter().all(RigDataset::is_rig)
        {
            self.recording.refuse_for_rig()?;
            if !self.with.is_empty() {
                let message =
                    "--with is for one camera: calibrate the rig with the effect (calibrate --with CAMERA:EFFECT)";
                return Err(Failure::Input(message.to_owned()));
            }
            let asked = RigEvaluate {
                calibration: &self.calibration,
                record,
                datasets: &self.datasets,
                reading: &self.reading,
                output: &self.output,
            };
            return rig::evaluate(&asked, session);
        }
        let known = given.size().map(|size| self.camera(&given, size, session));
        let mut known: Option<Camera> = known.transpose()?;
        let (mut datasets, mut all) = (Vec::new(), Vec::new());
        let (mut fitted, mut frames) = (None, Vec::new());
        for path in &self.datasets {
            let loaded = self.reading.load(path, session)?;
            let size = (loaded.capture.width, loaded.capture.height);
            // A camera file may have no size: that of the first images then holds for all.
            let camera = match known.take() {
                Some(camera) => camera,
                None => self.camera(&given, [size.0, size.1], session)?,
            };
            let camera = &*known.insert(camera);
            if size != (camera.width, camera.height) {
                return Err(Failure::Input(format!(
                    "{}: its images are {} × {} px, but the calibration is for {} × {} px",
                    path.display(),
                    size.0,
                    size.1,
                    camera.width,
                    camera.height
                )));
            }
            let role = if given.fitted_digest() == Some(loaded.reference.digest.as_str()) {
                fitted = Some(loaded.capture.name.clone());
                Role::Fitted
            } else {
                Role::Other
            };
            let busy = Progress::busy("measuring");
            let evaluated = session.evaluate(camera, &loaded.capture);
            drop(busy);
            print_not_evaluated(&evaluated, &loaded.capture.dropped);
            frames.push(frames_of(&evaluated.name, evaluated.frames.len(), &evaluated.dropped));
            let uncorrectable: usize = evaluated.frames.iter().map(|f| f.uncorrectable).sum();
            if uncorrectable > 0 {
                say!("  {} cannot be corrected by this model and are excluded", count(uncorrectable, "depth pixel"));
            }
            datasets.push(evaluated.record());
            all.push((evaluated, role, loaded.capture));
        }
        say!("\n{}", table(&datasets, fitted.as_deref()));
        if fitted.is_some() {
            say!("* the dataset that the calibration was fitted to");
        }
        let results = Results::begin(&self.output.out)?;
        let place = results.place();
        let values = value_of(&datasets)?;
        let evaluation = Evaluation { datasets, ..Evaluation::default() };
        let path = place.write("evaluation.json", |path| evaluation.write(path))?;
        let shown: Vec<ReportDataset<'_>> =
            all.iter().map(|(evaluated, role, _)| ReportDataset { evaluated, role: *role }).collect();
        let report = ReportInput {
            title: format!("Evaluation of {}", self.calibration.display()),
            command_line: command_line(),
            stages: session.progress.stage_times(),
            calibrated: None,
            evaluations: &shown,
            diagnosis: None,
            story: &[],
        };
        let report = place.write_report(&report, session)?;
        let recorded: Vec<_> = all.iter().map(|(evaluated, _, capture)| (capture, evaluated)).collect();
        let recording = known.as_ref().map(|camera| self.recording.write(camera, &recorded)).transpose()?.flatten();
        results.commit("evaluation.json", session)?;
        say!("written: {} and {}", path.display(), report.display());
        let written: Vec<_> = [path, report].into_iter().chain(recording).collect();
        Ok(json!({ "frames": frames, "datasets": values, "written": written }))
    }
}
