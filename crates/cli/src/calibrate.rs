use std::path::PathBuf;

use clap::{Args, ValueEnum};
use depthcal_io::Calibration;
use depthcal_model::{Block, ModelSpec};

use serde_json::{Value, json};

use super::common::{
    Failure, Output, Reading, command_line, frames_of, input, say_not_judged, value_of, write_calibration, write_report,
};
use super::recording::Recording;
use super::session::Session;
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::adjust::smoothness_prior::indices;
use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, Estimator, calibrate};
use depthcal_calibration::judge::cross_validation::{cross_validate, split};
use depthcal_calibration::judge::evaluate::{evaluate, table};
use depthcal_calibration::load::declared_camera;
use depthcal_report::{ReportDataset, ReportInput, Role};

/// Every `every`-th frame from number `first` on.
#[derive(Debug, Clone, Copy)]
struct HoldOut {
    every: usize,
    first: usize,
}

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

/// Fits a depth camera to the captures of a board: intrinsics, lens, depth distortion and poses.
///
/// Writes calibration.json (parameters, covariance, noise), evaluation.json (errors), observations.json and report.html.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal calibrate captures/ --out result/                       K, lens and projective D
  depthcal calibrate captures/ --cross-validate 3 --out result/    errors on frames that no fit saw
  depthcal calibrate captures/ --hold-out 4 --out result/          every fourth frame judges
  depthcal calibrate captures/ --model projective:xw --out r/      only dx and dw free
  depthcal calibrate captures/ --with cyclic_depth@period_mm=300 --out r/
  depthcal calibrate captures/ --rrd result.rrd --out result/      a recording for the rerun viewer too
  depthcal calibrate captures/ --json --out r/ | jq .calibration.camera")]
pub(super) struct Calibrate {
    /// Folder with a dataset.toml.
    dataset: PathBuf,
    /// Depth model: none, projective, projective:xw (only dx and dw free), or a stack such as projective+cyclic_depth.
    #[arg(long, default_value = "projective")]
    model: String,
    /// Further effects by name, at whatever hook they act.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// Lens model.
    #[arg(long, default_value = "brown-conrady", value_parser = ["brown-conrady", "none"])]
    lens: String,
    /// How the depth model is estimated: everything jointly, or D alone with camera and poses from the images.
    #[arg(long, value_enum, default_value = "joint")]
    estimator: EstimatorName,
    /// Evaluates on frames that the fit did not see: leaves every N-th frame out of the fit, counted from the K-th
    /// (from the first where K is not given).
    #[arg(long, value_name = "N[:K]", value_parser = parse_hold_out)]
    hold_out: Option<HoldOut>,
    /// Judges the model by N more fits, each without every N-th frame in turn: every frame is evaluated by a fit that
    /// did not see it. The calibration itself is fitted to all frames.
    #[arg(long, visible_alias = "folds", value_name = "N", conflicts_with = "hold_out", value_parser = clap::value_parser!(u16).range(2..))]
    cross_validate: Option<u16>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    recording: Recording,
    #[command(flatten)]
    output: Output,
}

impl Calibrate {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let mut options = CalibrateOptions {
            model: session.model("--model", &self.model)?,
            effects: session.effects(&self.with)?,
            lens: self.lens.clone(),
            estimator: match self.estimator {
                EstimatorName::Joint => Estimator::Joint,
                EstimatorName::Linear => Estimator::Linear,
                EstimatorName::Irls => Estimator::Irls,
                EstimatorName::Nonlinear => Estimator::Nonlinear,
            },
            ..session.calibrate_options()
        };
        self.recording.check()?;
        let loaded = self.reading.load(&self.dataset, session)?;
        let (fitted, held) = match self.hold_out {
            Some(hold_out) => {
                let (fitted, held) = split(&loaded.capture, hold_out.every, hold_out.first);
                (fitted, Some(held))
            }
            None => (loaded.capture.clone(), None),
        };
        let (width, height) = (loaded.capture.width, loaded.capture.height);
        options.camera = declared_camera(&loaded.dataset, width, height, &options.register);
        if !fitted.has_depth() && self.model == "projective" && self.with.is_empty() {
            say!("no depth images: camera and lens alone are fitted");
            options.model = ModelSpec::none();
        }
        let busy = Progress::busy("fitting");
        let result = calibrate(&fitted, &options)?;
        drop(busy);
        print_parameters(&result);
        let fitted = evaluate(&result.camera, &result.capture);
        let mut datasets = vec![fitted.record()];
        let held_out = match (&held, self.cross_validate) {
            (Some(held), _) => Some(("held out", evaluate(&result.camera, held))),
            (None, Some(folds)) => {
                Some(("cross-validated", cross_validate(&loaded.capture, usize::from(folds), &options)?))
            }
            (None, None) => None,
        };
        say_not_judged(&fitted, &result.capture.dropped);
        if let Some((how, evaluated)) = &held_out {
            say_not_judged(evaluated, &loaded.capture.dropped);
            let mut record = evaluated.record();
            record.name = format!("{} ({how})", record.name);
            datasets.push(record);
        }
        say!("\n{}", table(&datasets, Some(&result.capture.name)));
        let evaluation = value_of(&datasets)?;
        let written = write_calibration(&result, &fitted, &loaded, datasets, &self.output.out)?;
        let mut shown = vec![ReportDataset { evaluated: &fitted, role: Role::Fitted }];
        shown.extend(held_out.as_ref().map(|(_, evaluated)| ReportDataset { evaluated, role: Role::HeldOut }));
        let report = ReportInput {
            title: result.capture.name.clone(),
            command_line: command_line(),
            calibrated: Some(&result),
            evaluations: &shown,
            diagnosis: None,
            story: &[],
        };
        let report = write_report(&report, &self.output.out)?;
        say!("written: {} and {}", written.display(), report.display());
        // Cross-validation has a camera for every part; a recording is of one.
        let detected = result.capture.detected();
        let mut recorded = vec![(&detected, &fitted)];
        recorded.extend(held.as_ref().zip(held_out.as_ref().map(|(_, evaluated)| evaluated)));
        let recording = self.recording.write(&result.camera, &recorded)?;
        Ok(json!({
            "frames": frames_of(&result.capture.name, result.capture.frames.len(), &result.capture.dropped),
            "calibration": value_of(&Calibration::read(&written).map_err(input)?)?,
            "datasets": evaluation,
            "written": std::iter::once(written).chain([report]).chain(recording).collect::<Vec<_>>(),
        }))
    }
}

/// Blocks of more parameters than this are printed by their fields.
const MOST_PRINTED: usize = 24;

/// Every field of a block by its range, its roughness, and what determines it.
fn print_fields(result: &Calibrated, block: &Block) {
    let Some(layout) = block.piece().and_then(|p| p.field()) else { return };
    for field in result.smoothness.fields.iter().filter(|f| f.piece == block.name()) {
        let values = || indices(&layout, field.index).map(|i| block.theta[i]);
        let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let effective = field.effective.map_or_else(String::new, |e| format!(", {e:.1} effective parameters"));
        say!(
            "  {:6} {least:>14.6e} to {most:.6e}  {} nodes with data{effective}, roughness {:.2e}; {} without data stay neutral",
            field.field,
            field.nodes,
            field.roughness,
            field.untouched
        );
    }
    for i in layout.parameter_count() - layout.shared..layout.parameter_count() {
        let parameter = &block.parameters()[i];
        say!("  {:6} {:>14.6e} {}", parameter.name, block.theta[i], parameter.unit);
    }
}

/// Parameters with standard deviations, and how the fit went.
pub(super) fn print_parameters(result: &Calibrated) {
    let mut stds = result.std_devs().into_iter();
    for block in result.camera.blocks() {
        say!("{}", block.name());
        if block.theta.len() > MOST_PRINTED {
            print_fields(result, block);
            stds.nth(block.theta.len() - 1);
            continue;
        }
        for ((parameter, value), free) in block.parameters().iter().zip(&block.theta).zip(&block.free) {
            let std = match stds.next().flatten() {
                Some(std) => format!("± {std:.2e}"),
                None if *free => "no std. dev.".to_owned(),
                None => "held".to_owned(),
            };
            say!("  {:6} {value:>14.6e} {std:>13}  {}", parameter.name, parameter.unit);
        }
    }
    let noise = &result.noise;
    let depth = if result.with_depth {
        format!(", depth σρ² = ({:.2e}/mm)² + ({:.2} mm · ρ²)²", noise.depth.a_per_mm, noise.depth.b_mm)
    } else {
        String::new()
    };
    say!("noise: {:.3} px{depth}", noise.pixel_sigma);
    let samples: usize = result.capture.frames.iter().map(|f| f.samples.len()).sum();
    let apart = result.correlation_length_px.unwrap_or(1);
    say!(
        "{} frames, {samples} depth pixels at least {apart} px apart ({} outliers left out); {} after {} iterations",
        result.capture.frames.len(),
        result.outliers,
        result.termination,
        result.iterations
    );
    for frame in &result.capture.dropped {
        say!("not used: {} ({})", frame.name, frame.reason);
    }
}
