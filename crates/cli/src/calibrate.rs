//! `calibrate`: fits a camera to a dataset.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use depthcal_io::{Calibration, LensComparison, Prior, RigDataset};
use depthcal_model::Register;
use serde_json::{Value, json};

use super::common::{Output, Reading, command_line, frames_of, print_not_evaluated, value_of};
use super::failure::{Failure, input};
use super::formula_files;
use super::parameters::print_parameters;
use super::recording::Recording;
use super::results::Results;
use super::rig::{self, RigCalibrate};
use super::session::Session;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::adjust::camera_prior::CameraPrior;
use depthcal_calibration::calibrate::Estimator;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::task::{
    FitRequest, HoldOut, JudgedFit, LENSES, ModelRequest, OptionNames, prior_for, write_calibration,
};
use depthcal_report::format::{number, quantity};
use depthcal_report::{ReportDataset, ReportInput, Role, fit_sentences};

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
/// Writes calibration.json (parameters, covariance, noise), evaluation.json (errors), observations.json, scores.json (for fleets) and
/// report.html. A dataset with sections [cameras.NAME] is a rig of several cameras, which are fitted together with their places.
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
    dataset: PathBuf,
    /// Depth model: none, projective, projective:xw (only dx and dw free), or a stack such as projective+cyclic_depth.
    #[arg(long, default_value = "projective")]
    model: String,
    /// Further effects, such as thin_prism or cyclic_depth@period_mm=300; docs/model.md lists them. fixed:PIECE.PARAMETER holds
    /// a parameter instead of fitting it: fixed:brown_conrady.k3, fixed:pinhole.cx. Of one camera of a rig: colour:thin_prism,
    /// fixed:colour:pinhole.cx. colour:time_offset estimates by how much this camera exposes later than its times say, from a video of a
    /// board that moves.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// What other units of the camera's type say of this one: prior.json of `depthcal fleet`. Its parameters get a normal prior, and the
    /// fit starts at its mean, so that few frames are enough.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// Formulas that are scored in scores.json without being fitted: whether this unit confirms what another one found.
    #[arg(long, value_delimiter = ',', value_name = "FILE,…")]
    score: Vec<String>,
    /// Lens model [default: that of dataset.toml, else brown-conrady]. Terms of brown-conrady that the markers do not determine over the
    /// whole image are chosen on left-out frames; brown-conrady:full and the others fit what they say; auto compares all on left-out
    /// frames.
    #[arg(long, value_parser = LENSES)]
    lens: Option<String>,
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
    fn request(&self) -> FitRequest {
        FitRequest {
            model: ModelRequest {
                names: OptionNames::COMMAND_LINE,
                model: self.model.clone(),
                with: self.with.clone(),
                lens: self.lens.clone(),
            },
            estimator: self.estimator(),
            hold_out: self.hold_out,
            cross_validate: self.cross_validate.map(usize::from),
            parts: if self.blocks { Parts::Blocks } else { Parts::Interleaved },
        }
    }

    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        self.model = formula_files::resolve_model("--model", &self.model, register)?;
        self.with = formula_files::resolve("--with", &self.with, register)?;
        self.score = formula_files::resolve("--score", &self.score, register)?;
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

    /// The same for a dataset of several cameras.
    fn run_rig(&self, session: &Session) -> Result<Value, Failure> {
        self.recording.refuse_for_rig()?;
        if self.cross_validate.is_some() {
            let message = "--cross-validate is for one camera; of a rig, hold frames out with --hold-out N";
            return Err(Failure::Input(message.to_owned()));
        }
        if self.prior.is_some() || !self.score.is_empty() {
            return Err(Failure::Input("--prior and --score are for one camera: leave them out for a rig".to_owned()));
        }
        let asked = RigCalibrate {
            dataset: &self.dataset,
            model: session.model("--model", &self.model)?,
            with: &self.with,
            lens: self.lens.as_deref(),
            estimator: self.estimator(),
            hold_out: self.hold_out.map(|h| [h.every, h.first]),
            reading: &self.reading,
            output: &self.output,
        };
        rig::calibrate(&asked, session)
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        if RigDataset::is_rig(&self.dataset) {
            return self.run_rig(session);
        }
        let request = self.request();
        let mut options = request.options(session.calibrate_options())?;
        self.recording.check()?;
        self.output.check()?;
        let loaded = self.reading.load(&self.dataset, session)?;
        let size = [loaded.capture.width, loaded.capture.height];
        options.prior = self.prior.as_deref().map(|path| read_prior(path, size)).transpose()?;
        let prepared = request.prepare(&loaded, options)?;
        if prepared.images_only {
            say!("no depth images: only camera and lens are fitted");
        }
        let busy = Progress::busy("fitting");
        let fit = prepared.fit()?;
        drop(busy);
        let result = &fit.result;
        if let Some(comparison) = &result.lens_comparison {
            print_lenses(comparison);
        }
        print_parameters(result);
        let story = fit_sentences(result);
        story.iter().for_each(|sentence| say!("{sentence}"));
        let judged = fit.judge()?;
        let JudgedFit { fitted, held_out } = &judged;
        print_not_evaluated(fitted, &result.capture.dropped);
        if let Some((_, evaluated)) = held_out {
            print_not_evaluated(evaluated, &loaded.capture.dropped);
        }
        let datasets = judged.records();
        say!("\n{}", table(&datasets, Some(&result.capture.name)));
        let evaluation = value_of(&datasets)?;
        let results = Results::begin(&self.output.out)?;
        let place = results.place();
        place.write_into(|out| write_calibration(result, fitted, &loaded, datasets, &session.register, out))?;
        let mut shown = vec![ReportDataset { evaluated: fitted, role: Role::Fitted }];
        shown.extend(held_out.as_ref().map(|(_, evaluated)| ReportDataset { evaluated, role: Role::HeldOut }));
        let report = ReportInput {
            title: result.capture.name.clone(),
            command_line: command_line(),
            stages: session.progress.stage_times(),
            calibrated: Some(result),
            evaluations: &shown,
            diagnosis: None,
            story: &story,
        };
        let report = place.write_report(&report, session)?;
        let written = place.shown("calibration.json");
        // A recording is of one camera; cross-validation has one for every part.
        let detected = result.capture.detected();
        let mut recorded = vec![(&detected, fitted)];
        recorded.extend(fit.held.as_ref().zip(held_out.as_ref().map(|(_, evaluated)| evaluated)));
        let recording = self.recording.write(&result.camera, &recorded)?;
        results.commit("calibration.json", session)?;
        say!("written: {} and {}", written.display(), report.display());
        Ok(json!({
            "frames": frames_of(&result.capture.name, result.capture.frames.len(), &result.capture.dropped),
            "calibration": value_of(&Calibration::read(&written).map_err(input)?)?,
            "datasets": evaluation,
            "written": std::iter::once(written).chain([report]).chain(recording).collect::<Vec<_>>(),
        }))
    }
}

/// The prior in a file, for images of this size.
fn read_prior(path: &Path, size: [usize; 2]) -> Result<Arc<CameraPrior>, Failure> {
    let prior = Prior::read(path).map_err(input)?;
    let own = prior_for(&path.display().to_string(), &prior, size)?;
    if !prior.with.is_empty() {
        say!("the prior's units have these effects in their models: --with {}", prior.with.join(","));
    }
    Ok(Arc::new(own))
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
