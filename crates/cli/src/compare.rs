//! `compare`: compares depth models.

use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_io::RigDataset;
use depthcal_model::{ModelSpec, Register};

use serde_json::{Value, json};

use super::common::{Output, Reading, command_line, frames_of, value_of};
use super::failure::{Failure, input};
use super::formula_files;
use super::results::Results;
use super::rig;
use super::session::Session;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::calibrate::rig::{RigOptions, calibrate_rig};
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::compare::tables::tables;
use depthcal_calibration::compare::{CompareOptions, compare};
use depthcal_calibration::diagnose::rig::examined;
use depthcal_calibration::load::LoadedRig;
use depthcal_calibration::observe::Capture;
use depthcal_calibration::task::{LENSES, ModelRequest, OptionNames};
use depthcal_report::render_comparison;

/// Compares depth models on held-out data.
///
/// Each model is fitted to TRAIN and evaluated on the datasets of --verify or, without any, by cross-validation on TRAIN.
/// Prints the ranking with intervals from resampled frames, which differences are significant, and the tables of Sjöholm
/// 2017 for all subsets of D. Writes comparison.json and report.html; of a rig of several cameras, of each with depth in a folder of
/// its name.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal compare captures/ --out compared/                       cross-validation
  depthcal compare captures/ --verify other/ third/ --out compared/
  depthcal compare captures/ --models none,projective,projective+bspline --no-thesis --out compared/
  depthcal compare captures/ --json --out compared/ | jq '.comparison.models[].model'")]
pub(super) struct Compare {
    /// Folder with a dataset.toml: the dataset that the models are fitted to.
    train: PathBuf,
    /// Datasets that the models are evaluated on.
    #[arg(long, num_args = 1.., value_name = "DATASET")]
    verify: Vec<PathBuf>,
    /// Depth models: none, projective, projective:xw, bspline, projective+bspline, multiplier@columns=16@rows=12, …
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "MODEL,…",
        default_value = "none,projective:xw,projective,bspline,multiplier,disparity_decay,polynomial_map,projective+bspline"
    )]
    models: Vec<String>,
    /// Further effects that are part of every model; fixed:PIECE.PARAMETER holds a parameter instead of fitting it.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// Lens model [default: that of dataset.toml, else brown-conrady]. Terms of brown-conrady that the markers do not determine over the
    /// whole image are chosen on left-out frames; brown-conrady:full and the others fit what they say; auto compares all on left-out
    /// frames.
    #[arg(long, value_parser = LENSES)]
    lens: Option<String>,
    /// Parts of the cross-validation, without --verify.
    #[arg(long, value_name = "N", default_value = "6", value_parser = clap::value_parser!(u16).range(2..))]
    folds: u16,
    /// Omits the tables of Sjöholm 2017: subsets of D, with and without lens, four estimators, stability of D.
    #[arg(long)]
    no_thesis: bool,
    /// Fits per number of frames in the learning curve; 0: no learning curve.
    #[arg(long, default_value = "3", value_name = "N")]
    learning: u16,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Compare {
    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        for model in &mut self.models {
            *model = formula_files::resolve_model("--models", model, register)?;
        }
        self.with = formula_files::resolve("--with", &self.with, register)?;
        Ok(())
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let models = self.models.iter().map(|m| session.model("--models", m)).collect::<Result<Vec<_>, _>>()?;
        self.output.check()?;
        if RigDataset::is_rig(&self.train) {
            return self.run_rig(&models, session);
        }
        let request = ModelRequest {
            names: OptionNames::COMMAND_LINE,
            // Replaced by those that are compared.
            model: "projective".to_owned(),
            with: self.with.clone(),
            lens: self.lens.clone(),
        };
        let base = request.options(session.calibrate_options())?;
        let train = self.reading.load(&self.train, session)?;
        let verify = self.verify.iter().map(|path| self.reading.load(path, session)).collect::<Result<Vec<_>, _>>()?;
        let base = request.for_dataset(base, &train)?;
        let captures: Vec<Capture> = verify.into_iter().map(|v| v.capture).collect();
        self.compare(&train.capture, &captures, models, base, &self.output.out, session)
    }

    /// Compares models on every camera of a rig that has depth, each in a folder of its name.
    fn run_rig(&self, models: &[ModelSpec], session: &Session) -> Result<Value, Failure> {
        let rig = rig::load(&self.train, &self.reading, session)?;
        let verify =
            self.verify.iter().map(|path| rig::load(path, &self.reading, session)).collect::<Result<Vec<_>, _>>()?;
        let mut options =
            RigOptions { each: session.calibrate_options(), lens: self.lens.clone(), ..RigOptions::default() };
        rig::add_effects(&self.with, &rig, &mut options)?;
        let fit = calibrate_rig(&rig.capture, &options)?;
        let mut cameras = Vec::new();
        for own in rig.capture.cameras.iter().filter(|c| c.capture.has_depth()) {
            say!("\n[{}]", own.name);
            let Some((train, base)) = examined(own, &fit, &options)? else { continue };
            // In another dataset a camera without images has no poses of its own; its frames are cross-validated.
            let of = |v: &LoadedRig| v.capture.cameras.iter().find(|c| c.name == own.name).map(|c| c.capture.clone());
            let captures: Vec<Capture> =
                if own.has_markers() { verify.iter().filter_map(of).collect() } else { Vec::new() };
            let out = self.output.out.join(&own.name);
            let mut value = self.compare(&train, &captures, models.to_vec(), base, &out, session)?;
            value["camera"] = json!(own.name);
            cameras.push(value);
        }
        if cameras.is_empty() {
            let name = &rig.dataset.name;
            return Err(Failure::Input(format!("no camera of '{name}' has depth: nothing to compare")));
        }
        Ok(json!({ "cameras": cameras }))
    }

    /// Compares models on the captures of one camera and writes the files into `out`.
    fn compare(
        &self,
        train: &Capture,
        captures: &[Capture],
        models: Vec<ModelSpec>,
        base: CalibrateOptions,
        out: &Path,
        session: &Session,
    ) -> Result<Value, Failure> {
        for capture in std::iter::once(train).chain(captures) {
            if !capture.has_depth() {
                let name = &capture.name;
                return Err(Failure::Input(format!("the dataset '{name}' has no depth images: nothing to compare")));
            }
        }
        if captures.is_empty() && train.frames.len() < usize::from(self.folds) {
            return Err(Failure::Input(format!(
                "--folds {} needs as many frames, but the board was found in {}: give fewer folds or --verify",
                self.folds,
                train.frames.len()
            )));
        }
        let options = CompareOptions {
            models,
            calibrate: base,
            folds: usize::from(self.folds),
            thesis: !self.no_thesis,
            learning_fits: usize::from(self.learning),
            ..CompareOptions::default()
        };
        let busy = Progress::busy("comparing models");
        let comparison = compare(train, captures, &options).map_err(input)?;
        // Fitted again for its maps in the report: the comparison keeps no cameras.
        let stage = session.progress.stage("fitting the best model");
        let best = comparison.models.first().filter(|m| m.failed.is_none()).and_then(|best| {
            let model = session.register.model_spec(&best.model).ok()?;
            let options = CalibrateOptions { model, ..options.calibrate.clone() };
            calibrate(train, &options).ok()
        });
        drop((stage, busy));
        let tables = tables(&comparison);
        for table in &tables {
            say!("\n{}\n{}", table.title, table.text);
        }
        for sentence in &comparison.verdict {
            say!("{sentence}");
        }
        let results = Results::begin(out)?;
        let place = results.place();
        let path = place.write("comparison.json", |path| comparison.write(path))?;
        let times = session.progress.stage_times();
        let stage = session.progress.stage("report");
        let html = render_comparison(&comparison, &tables, best.as_ref(), &command_line(), &times).map_err(input)?;
        let report = place.write_text("report.html", &html)?;
        drop(stage);
        results.commit("comparison.json", session)?;
        say!("written: {} and {}", path.display(), report.display());
        if comparison.models.iter().all(|m| m.failed.is_some()) {
            return Err(Failure::Untrusted(comparison.verdict.join(" ")));
        }
        let frames: Vec<Value> =
            std::iter::once(train).chain(captures).map(|c| frames_of(&c.name, c.frames.len(), &c.dropped)).collect();
        Ok(json!({ "frames": frames, "comparison": value_of(&comparison)?, "written": [path, report] }))
    }
}
