//! `calibrate`: fits a camera to a dataset.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use depthcal_formula::resolve;
use depthcal_io::{Calibration, LensComparison, Prior};
use depthcal_model::Register;
use serde_json::{Value, json};

use super::common::{Output, Reading, camera_count, frames_of, made, print_not_evaluated, value_of};
use super::failure::{Failure, input};
use super::model_options::ModelOptions;
use super::parameters::print_cameras;
use super::recording::Recording;
use super::results::save;
use super::session::Session;
use super::transfers::print_transfers;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::calibrate::{CalibratedCamera, CameraFit, Estimator};
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::observe::Capture;
use depthcal_calibration::task::{Fit, FitRequest, GivenPrior, HoldOut, NextRequest};
use depthcal_report::format::{number, quantity};
use depthcal_report::{fit_sentences, next_sentence};

/// Most free parameters of a camera for which the next capture is told.
const MOST_PLANNED: usize = 40;

fn parse_hold_out(text: &str) -> Result<HoldOut, String> {
    let (every, first) = text.split_once(':').unwrap_or((text, "1"));
    let number = |t: &str| t.parse::<usize>().map_err(|_| format!("'{t}' is not a number"));
    let (every, first) = (number(every)?, number(first)?);
    if every < 2 || first < 1 || first > every {
        return Err("N must be at least 2 and K from 1 to N".to_owned());
    }
    Ok(HoldOut { every, first: first - 1 })
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum EstimatorName {
    Joint,
    Linear,
    Irls,
    Nonlinear,
}

/// Fits a depth camera to captures of a board: intrinsics, lens, depth distortion and poses.
///
/// Writes calibration.json (parameters, covariance, noise), evaluation.json (errors), observations.json, scores.json (for fleets)
/// and report.html. A dataset with sections [cameras.NAME] is a rig of several cameras, which are fitted together with their
/// extrinsics.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal calibrate captures/ --out result/                       K, lens and projective D
  depthcal calibrate captures/ --cross-validate 3 --out result/    errors on held-out frames
  depthcal calibrate captures/ --hold-out 4 --out result/          every fourth frame is held out
  depthcal calibrate captures/ --model projective:xw --out r/      only dx and dw free
  depthcal calibrate captures/ --with cyclic_depth@period_mm=300 --out r/
  depthcal calibrate captures/ --prior fleet/prior.json --out r/   few frames, with what other units say
  depthcal calibrate captures/ --rrd result.rrd --out result/      also a recording for the rerun viewer
  depthcal calibrate captures/ --json --out r/ | jq .calibration.camera")]
pub(super) struct Calibrate {
    /// Folder with a dataset.toml.
    pub(super) dataset: PathBuf,
    #[command(flatten)]
    model: ModelOptions,
    /// Knowledge from other units of the camera's type: prior.json of `depthcal fleet`. Its parameters get a normal prior,
    /// and the fit starts at its mean, so that few frames are enough. Of a camera of a rig: CAMERA:FILE.
    #[arg(long, value_delimiter = ',', value_name = "FILE")]
    prior: Vec<String>,
    /// Formulas that are scored in scores.json without being fitted: whether this unit confirms what another one found.
    #[arg(long, value_delimiter = ',', value_name = "FILE,…")]
    score: Vec<String>,
    /// Estimator: joint fits everything together; the others fit D alone, with camera and poses from the images.
    #[arg(long, value_enum, default_value = "joint")]
    estimator: EstimatorName,
    /// Holds out every N-th frame, beginning with the K-th [default: the first]: these frames are not fitted but evaluated.
    #[arg(long, value_name = "N[:K]", value_parser = parse_hold_out)]
    hold_out: Option<HoldOut>,
    /// Evaluates every frame with a model that was fitted without it: N further fits, each without every N-th frame. The
    /// calibration itself is fitted to all frames.
    #[arg(long, visible_alias = "folds", value_name = "N", conflicts_with = "hold_out", value_parser = clap::value_parser!(u16).range(2..))]
    cross_validate: Option<u16>,
    /// The parts of --cross-validate are blocks of consecutive frames: neighbours of a sweep are alike, so that errors on frames
    /// whose neighbours were fitted are too small.
    #[arg(long, requires = "cross_validate")]
    blocks: bool,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    recording: Recording,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Calibrate {
    fn request(&self) -> Result<FitRequest, Failure> {
        let priors = self.prior.iter().map(|text| {
            // A file whose name has a colon is one; else what is before the colon names a camera.
            let (camera, path) = match text.split_once(':') {
                Some((camera, path)) if !Path::new(text).exists() => (Some(camera.to_owned()), path),
                _ => (None, text.as_str()),
            };
            Ok::<_, Failure>(GivenPrior { camera, name: path.to_owned(), prior: Prior::read(path).map_err(input)? })
        });
        let priors = priors.collect::<Result<_, _>>()?;
        Ok(FitRequest {
            model: self.model.model(),
            estimator: self.estimator(),
            hold_out: self.hold_out,
            cross_validate: self.cross_validate.map(usize::from),
            parts: if self.blocks { Parts::Blocks } else { Parts::Interleaved },
            priors,
        })
    }

    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        self.model.load_formulas(register)?;
        self.score = resolve("--score", &self.score, register)?;
        Ok(())
    }

    fn estimator(&self) -> Estimator {
        match self.estimator {
            EstimatorName::Joint => Estimator::Joint,
            EstimatorName::Linear => Estimator::Linear,
            EstimatorName::Irls => Estimator::Irls,
            EstimatorName::Nonlinear => Estimator::Nonlinear,
        }
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let request = self.request()?;
        let cameras = camera_count(&self.dataset, |cameras| request.check(cameras, &session.register))?;
        if cameras > 1 {
            self.recording.refuse_for_rig()?;
            if !self.score.is_empty() {
                return Err(Failure::Input("--score is for one camera: leave it out for a rig".to_owned()));
            }
        }
        self.recording.check()?;
        self.output.prepare()?;
        let loaded = self.reading.load(&self.dataset, session)?;
        for GivenPrior { name, prior, .. } in request.priors.iter().filter(|given| !given.prior.with.is_empty()) {
            say!("the units of {name} have these effects in their models: --with {}", prior.with.join(","));
        }
        let busy = Progress::busy("fitting");
        let fit = request.fit(&loaded, session.calibrate_options())?;
        drop(busy);
        print_fit(&fit);
        for (camera, evaluated) in &fit.on_fitted.cameras {
            let fitted = fit.fitted.camera(camera);
            print_not_evaluated(evaluated, fitted.map_or(&[], |fitted| &fitted.calibrated.capture.dropped));
        }
        for (camera, evaluated) in fit.held_out.iter().flat_map(|held_out| &held_out.evaluated.cameras) {
            let loaded = loaded.cameras.iter().find(|loaded| cameras == 1 || loaded.name() == camera);
            print_not_evaluated(evaluated, loaded.map_or(&[], |loaded| &loaded.capture.dropped));
        }
        say!("\n{}", fit.table());
        print_transfers(&fit.evaluation.transfer);
        print_next(&fit);
        let out = &self.output.out;
        let recording = save(&fit, &made(session), out, session, || self.record(&fit))?;
        let [written, report] = ["calibration.json", "report.html"].map(|name| out.join(name));
        say!("written: {} and {}", written.display(), report.display());
        let used = fit.fitted.cameras.iter().map(|CameraFit { name, calibrated, .. }| {
            let capture = &calibrated.capture;
            let name = if cameras == 1 { &capture.name } else { name };
            frames_of(name, capture.frames.len(), &capture.dropped)
        });
        let used: Vec<Value> = used.collect();
        let files: Vec<PathBuf> = [written.clone(), report].into_iter().chain(recording).collect();
        let mut value = json!({
            "frames": if cameras == 1 { used[0].clone() } else { json!(used) },
            "calibration": value_of(&Calibration::read(&written).map_err(input)?)?,
            "datasets": value_of(&fit.evaluation.datasets)?,
            "written": files,
        });
        if cameras > 1 {
            value["transfer"] = value_of(&fit.evaluation.transfer)?;
        }
        Ok(value)
    }

    /// Writes the recording of one camera; cross-validation has a camera for every part.
    fn record(&self, fit: &Fit) -> Result<Option<PathBuf>, Failure> {
        let (Some(result), [(_, on_fitted)]) = (fit.fitted.only_camera(), &fit.on_fitted.cameras[..]) else {
            return Ok(None);
        };
        let detected = result.capture.detected();
        let mut recorded = vec![(&detected, on_fitted)];
        let held = fit.held_out.as_ref().and_then(|held| held.capture.as_ref().zip(held.evaluated.cameras.first()));
        let frames = |capture: &Capture| capture.cameras.first().map(|camera| camera.capture.clone());
        let held = held.and_then(|(capture, (_, evaluated))| Some((frames(capture)?, evaluated)));
        recorded.extend(held.iter().map(|(capture, evaluated)| (capture, *evaluated)));
        self.recording.write(&result.camera, &recorded)
    }
}

/// Prints the cameras of a fit with their parameters, and what a reader has to know before the numbers.
fn print_fit(fit: &Fit) {
    if fit.images_only {
        say!("no depth images: only camera and lens are fitted");
    }
    let cameras = &fit.fitted.cameras;
    cameras.iter().filter_map(|camera| camera.calibrated.lens_comparison.as_ref()).for_each(print_lenses);
    print_cameras(&fit.fitted);
    for CameraFit { name, calibrated, .. } in cameras {
        let whose = if cameras.len() > 1 { format!("{name}: ") } else { String::new() };
        fit_sentences(calibrated).iter().for_each(|sentence| say!("{whose}{sentence}"));
    }
}

/// Prints which capture would help most. Of rigs and of models of many parameters, whose plans take long, `next` tells.
fn print_next(fit: &Fit) {
    let is_small = |calibrated: &CalibratedCamera| calibrated.camera.free_parameters().len() <= MOST_PLANNED;
    if fit.fitted.only_camera().is_some_and(is_small) {
        let request = NextRequest { poses: 1, ..NextRequest::default() };
        // Fits without a covariance cannot be planned for.
        if let Ok(next) = request.next(&fit.fitted) {
            say!("{}", next_sentence(&next));
        }
    }
}

/// The comparison of lenses, as a table.
fn print_lenses(comparison: &LensComparison) {
    say!("lens             parameters  left-out frames   worse than the best");
    for lens in &comparison.lenses {
        let error = lens.held_out_px.map_or("not fitted".to_owned(), |px| quantity(px, "px"));
        let worse = match (&lens.failed, lens.worse_by_standard_errors) {
            (Some(reason), _) => reason.clone(),
            (None, Some(worse)) if worse > 0.0 => format!("{} standard errors", number(worse)),
            _ => "–".to_owned(),
        };
        let fold = if lens.one_to_one || lens.failed.is_some() { "" } else { ", not one-to-one over the image" };
        let mark = if lens.lens == comparison.chosen { "*" } else { " " };
        say!("{mark} {:<16} {:>8}  {error:>15}   {worse}{fold}", lens.lens, lens.parameters);
    }
    say!("* is the simplest within one standard error of the best and is fitted");
}
