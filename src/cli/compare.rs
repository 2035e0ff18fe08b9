use std::path::PathBuf;

use clap::Args;
use depthcal_io::write_atomically;

use super::common::{Failure, Output, Reading, command_line, input};
use crate::calibrate::CalibrateOptions;
use crate::capture::declared_camera;
use crate::compare::tables::tables;
use crate::compare::{CompareOptions, compare};
use crate::report::render_comparison;

/// Compares depth models on data that their fits did not see.
///
/// Each model is fitted to TRAIN and judged on the datasets of --verify, or, without any, on frames of TRAIN that several
/// fits leave out in turn. Prints the ranking with intervals from resampled frames, says which differences are real, and
/// prints the tables of Sjöholm 2017 for all subsets of D.
#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Folder with a dataset.toml: what the models are fitted to.
    train: PathBuf,
    /// Datasets that the models are judged on.
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
    /// Further effects that every model is given.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// Parts into which the frames of TRAIN are divided where there is no --verify.
    #[arg(long, default_value = "6", value_parser = clap::value_parser!(u16).range(2..))]
    folds: u16,
    /// Leaves out the thesis' tables: subsets of D, lens or none, four estimators, stability of D.
    #[arg(long)]
    no_thesis: bool,
    /// Fits per number of frames in the learning curve; 0 for no learning curve.
    #[arg(long, default_value = "3", value_name = "N")]
    learning: u16,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    output: Output,
}

impl Compare {
    pub(super) fn run(&self) -> Result<(), Failure> {
        let mut calibrate = CalibrateOptions { effects: self.with.clone(), ..CalibrateOptions::default() };
        for model in &self.models {
            calibrate.register.depth_model(model).map_err(|e| Failure::Input(format!("--models {model}: {e}")))?;
        }
        for name in &self.with {
            calibrate.register.block(name, None).map_err(|e| Failure::Input(format!("--with {name}: {e}")))?;
        }
        let train = self.reading.load(&self.train)?;
        let verify = self.verify.iter().map(|path| self.reading.load(path)).collect::<Result<Vec<_>, _>>()?;
        for loaded in std::iter::once(&train).chain(&verify) {
            if !loaded.capture.has_depth() {
                let name = &loaded.capture.name;
                return Err(Failure::Input(format!("the dataset '{name}' has no depth images: nothing to compare")));
            }
        }
        if verify.is_empty() && train.capture.frames.len() < usize::from(self.folds) {
            return Err(Failure::Input(format!(
                "--folds {} needs as many frames, but the board was found in {}: give fewer folds or --verify",
                self.folds,
                train.capture.frames.len()
            )));
        }
        let (width, height) = (train.capture.width, train.capture.height);
        calibrate.camera = declared_camera(&train.dataset, width, height, &calibrate.register);
        let options = CompareOptions {
            models: self.models.clone(),
            calibrate,
            folds: usize::from(self.folds),
            thesis: !self.no_thesis,
            learning_fits: usize::from(self.learning),
            ..CompareOptions::default()
        };
        let captures: Vec<_> = verify.into_iter().map(|v| v.capture).collect();
        let comparison = compare(&train.capture, &captures, &options).map_err(input)?;
        let tables = tables(&comparison);
        for table in &tables {
            println!("\n{}\n{}", table.title, table.text);
        }
        for sentence in &comparison.verdict {
            println!("{sentence}");
        }
        let path = self.output.file("comparison.json");
        comparison.write(&path).map_err(input)?;
        let html = render_comparison(&comparison, &tables, &command_line()).map_err(input)?;
        let report = self.output.file("report.html");
        write_atomically(&report, |file| file.write_all(html.as_bytes())).map_err(input)?;
        println!("written: {} and {}", path.display(), report.display());
        if comparison.models.iter().all(|m| m.failed.is_some()) {
            return Err(Failure::Untrusted(comparison.verdict.join(" ")));
        }
        Ok(())
    }
}
