//! `compare`: compares depth models.

use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_formula::{resolve, resolve_lens, resolve_model};
use depthcal_model::Register;
use serde_json::{Value, json};

use super::common::{Output, Reading, frames_of, made, value_of};
use super::failure::Failure;
use super::results::save;
use super::session::Session;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::compare::tables::tables;
use depthcal_calibration::task::{CompareRequest, Compared, ModelRequest, OptionNames};

/// Compares depth models on held-out data.
///
/// Each model is fitted to TRAIN and evaluated on the datasets of --verify or, without any, by cross-validation on TRAIN.
/// Prints the ranking with intervals from resampled frames, which differences are significant, and with --tables the tables of
/// Sjöholm 2017 for all subsets of D. Writes comparison.json and report.html; of a rig of several cameras, of each with depth in
/// a folder of its name.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal compare captures/ --out compared/                       cross-validation
  depthcal compare captures/ --verify other/ third/ --out compared/
  depthcal compare captures/ --models none,projective,projective+bspline --out compared/
  depthcal compare captures/ --json --out compared/ | jq '.comparison.models[].model'")]
pub(super) struct Compare {
    /// Folder with a dataset.toml: the dataset that the models are fitted to.
    pub(super) train: PathBuf,
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
    /// Lens model [default: that of dataset.toml, else brown-conrady]. Terms of brown-conrady that the markers do not determine
    /// over the whole image are chosen on left-out frames; brown-conrady:full (k1k2p1p2, k1k2, k1), opencv8, opencv12, opencv14,
    /// kannala-brandt, division and none fit what they say; auto compares all on left-out frames. A lens of your own is given by
    /// its name, or as a file of its formula.
    #[arg(long)]
    lens: Option<String>,
    /// Parts of the cross-validation, without --verify.
    #[arg(long, value_name = "N", default_value = "6", value_parser = clap::value_parser!(u16).range(2..))]
    folds: u16,
    /// Adds the tables of Sjöholm 2017: subsets of D, with and without lens, four estimators, stability of D. They take several
    /// times as long as the ranking.
    #[arg(long)]
    tables: bool,
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
            *model = resolve_model("--models", model, register)?;
        }
        self.with = resolve("--with", &self.with, register)?;
        self.lens = resolve_lens("--lens", self.lens.as_deref(), register)?;
        Ok(())
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let models = self.models.iter().map(|m| session.model("--models", m)).collect::<Result<Vec<_>, _>>()?;
        self.output.prepare()?;
        let request = CompareRequest {
            model: ModelRequest {
                names: OptionNames::COMMAND_LINE,
                // Replaced by those that are compared.
                model: "projective".to_owned(),
                with: self.with.clone(),
                lens: self.lens.clone(),
            },
            models,
            folds: usize::from(self.folds),
            thesis: self.tables,
            learning_fits: usize::from(self.learning),
        };
        let train = self.reading.load(&self.train, session)?;
        let verify = self.verify.iter().map(|path| self.reading.load(path, session)).collect::<Result<Vec<_>, _>>()?;
        let busy = Progress::busy("comparing models");
        let compared = request.compare(&train, &verify, session.calibrate_options())?;
        drop(busy);
        let is_rig = train.cameras.len() > 1;
        let mut values = Vec::new();
        for compared in &compared {
            let mut out = self.output.out.clone();
            if is_rig {
                say!("\n[{}]", compared.camera);
                out.push(&compared.camera);
            }
            let mut value = tell(compared, &out, session)?;
            if is_rig {
                value["camera"] = json!(compared.camera);
            }
            values.push(value);
        }
        Ok(match values.pop() {
            Some(only) if !is_rig => only,
            last => json!({ "cameras": values.into_iter().chain(last).collect::<Vec<_>>() }),
        })
    }
}

/// Prints the comparison of one camera and writes its files into `out`; returns what `--json` prints.
fn tell(compared: &Compared, out: &Path, session: &Session) -> Result<Value, Failure> {
    let comparison = &compared.record;
    for table in &tables(comparison) {
        say!("\n{}\n{}", table.title, table.text);
    }
    for sentence in &comparison.verdict {
        say!("{sentence}");
    }
    save(compared, &made(session), out, session, || Ok(()))?;
    let [path, report] = ["comparison.json", "report.html"].map(|name| out.join(name));
    say!("written: {} and {}", path.display(), report.display());
    if compared.is_untrusted() {
        return Err(Failure::Untrusted(comparison.verdict.join(" ")));
    }
    let frames: Vec<Value> = compared.captures.iter().map(|c| frames_of(&c.name, c.frames.len(), &c.dropped)).collect();
    Ok(json!({ "frames": frames, "comparison": value_of(comparison)?, "written": [path, report] }))
}
