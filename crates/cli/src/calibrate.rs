//! `calibrate`: fits a camera to a dataset.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use depthcal_io::{Calibration, LensComparison, Prior};
use depthcal_model::{Block, ModelSpec, Parameter, Register};

use serde_json::{Value, json};

use super::common::{
    Output, Reading, command_line, frames_of, print_not_evaluated, value_of, write_calibration, write_report,
};
use super::failure::{Failure, input};
use super::formula_files;
use super::recording::Recording;
use super::session::{LENSES, Session, lens_of};
use super::voice::say;
use crate::progress::Progress;
use depthcal_calibration::adjust::camera_prior::CameraPrior;
use depthcal_calibration::adjust::smoothness_prior::indices;
use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, Estimator, calibrate};
use depthcal_calibration::calibration_record::prior_use;
use depthcal_calibration::judge::cross_validation::{cross_validate, split};
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::load::declared_camera;
use depthcal_report::format::{Measured, count, interval, measured, number, p_equals, percent, quantity};
use depthcal_report::{ReportDataset, ReportInput, Role};

/// Every `every`-th frame, beginning with number `first` (from 0).
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

/// Fits a depth camera to captures of a board: intrinsics, lens, depth distortion and poses.
///
/// Writes calibration.json (parameters, covariance, noise), evaluation.json (errors), observations.json, scores.json (for fleets) and
/// report.html.
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
    /// a parameter instead of fitting it: fixed:brown_conrady.k3, fixed:pinhole.cx.
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
    output: Output,
}

impl Calibrate {
    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        self.model = formula_files::resolve_model("--model", &self.model, register)?;
        self.with = formula_files::resolve("--with", &self.with, register)?;
        self.score = formula_files::resolve("--score", &self.score, register)?;
        Ok(())
    }

    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        let (effects, held) = session.effects(&self.with)?;
        let mut options = CalibrateOptions {
            model: session.model("--model", &self.model)?,
            effects,
            held,
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
        options.prior = self.prior.as_deref().map(|path| read_prior(path, [width, height])).transpose()?;
        options.lens = lens_of(self.lens.as_deref(), &loaded.dataset);
        options.camera =
            declared_camera(&loaded.dataset, width, height, self.lens.as_deref(), &options.register).map_err(input)?;
        if !fitted.has_depth() && self.model == "projective" && self.with.is_empty() {
            say!("no depth images: only camera and lens are fitted");
            options.model = ModelSpec::none();
        }
        let busy = Progress::busy("fitting");
        let result = calibrate(&fitted, &options)?;
        drop(busy);
        if let Some(comparison) = &result.lens_comparison {
            print_lenses(comparison);
            // Parts of a cross-validation are fitted with the lens of the whole.
            options.lens.clone_from(&comparison.chosen);
        }
        print_parameters(&result);
        let prior = prior_sentences(&result);
        prior.iter().for_each(|sentence| say!("{sentence}"));
        let fitted = session.evaluate(&result.camera, &result.capture);
        let mut datasets = vec![fitted.record()];
        let held_out = match (&held, self.cross_validate) {
            (Some(held), _) => Some(("held out", session.evaluate(&result.camera, held))),
            (None, Some(folds)) => {
                let how = if self.blocks { Parts::Blocks } else { Parts::Interleaved };
                Some(("cross-validated", cross_validate(&result, usize::from(folds), how, &options)?))
            }
            (None, None) => None,
        };
        print_not_evaluated(&fitted, &result.capture.dropped);
        if let Some((how, evaluated)) = &held_out {
            print_not_evaluated(evaluated, &loaded.capture.dropped);
            let mut record = evaluated.record();
            record.name = format!("{} ({how})", record.name);
            datasets.push(record);
        }
        say!("\n{}", table(&datasets, Some(&result.capture.name)));
        let evaluation = value_of(&datasets)?;
        let written = write_calibration(&result, &fitted, &loaded, datasets, &session.register, &self.output.out)?;
        let mut shown = vec![ReportDataset { evaluated: &fitted, role: Role::Fitted }];
        shown.extend(held_out.as_ref().map(|(_, evaluated)| ReportDataset { evaluated, role: Role::HeldOut }));
        let report = ReportInput {
            title: result.capture.name.clone(),
            command_line: command_line(),
            stages: session.progress.stage_times(),
            calibrated: Some(&result),
            evaluations: &shown,
            diagnosis: None,
            story: &prior,
        };
        let report = write_report(&report, session, &self.output.out)?;
        say!("written: {} and {}", written.display(), report.display());
        // A recording is of one camera; cross-validation has one for every part.
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

/// The prior in a file, for images of this size.
fn read_prior(path: &Path, [width, height]: [usize; 2]) -> Result<Arc<CameraPrior>, Failure> {
    let prior = Prior::read(path).map_err(input)?;
    if [prior.width, prior.height] != [width, height] {
        return Err(Failure::Input(format!(
            "{}: is for images of {}×{} px, but those of the dataset have {width}×{height}: give the prior of this camera type",
            path.display(),
            prior.width,
            prior.height
        )));
    }
    if !prior.with.is_empty() {
        say!("the prior's units have these effects in their models: --with {}", prior.with.join(","));
    }
    Ok(Arc::new(CameraPrior::from(&prior)))
}

/// What a fit's prior did, in sentences; none without a prior.
fn prior_sentences(result: &Calibrated) -> Vec<String> {
    let Some(prior) = &result.prior else { return Vec::new() };
    let Some(used) = prior_use(result) else {
        return vec!["The prior concerns no parameter of this model: it was not used.".to_owned()];
    };
    let mut sentences = vec![format!(
        "A prior from {} was used for {}. In its terms this camera is {} standard deviations from the mean of the others in all ({}).",
        count(used.units, "unit"),
        count(used.parameters.len(), "parameter"),
        number(used.distance_squared.sqrt()),
        p_equals(used.p_value)
    )];
    if used.p_value < UNLIKE_THE_OTHERS {
        sentences.push(
            "This camera is not like the others: calibrate it with more frames and without the prior, and compare."
                .to_owned(),
        );
    }
    let unused: Vec<&str> = prior
        .names
        .iter()
        .filter(|name| used.parameters.iter().all(|p| p.name != **name))
        .map(String::as_str)
        .collect();
    if !unused.is_empty() {
        sentences.push(format!("The prior also names {}, which are not fitted here.", unused.join(", ")));
    }
    let shares: Vec<String> =
        used.parameters.iter().map(|p| format!("{} {}", p.name, percent(100.0 * p.own_share))).collect();
    sentences.push(format!("Information from this camera's own frames: {}.", shares.join(", ")));
    sentences
}

/// p-value below which a camera is said to be unlike the units of its prior.
const UNLIKE_THE_OTHERS: f64 = 0.001;

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

/// Blocks of more parameters than this are printed by their fields.
const MOST_PRINTED: usize = 24;

/// One line: a name, a value, what is known about it, a unit.
fn print_parameter(parameter: &Parameter, shown: &Measured, unknown: &str) {
    let std = shown.std.as_ref().map_or_else(|| unknown.to_owned(), |std| format!("± {std}"));
    let unit = if parameter.unit == "1" { "" } else { parameter.unit };
    let line = format!("  {:6} {:>12} {std:<12} {unit}", parameter.name, shown.value);
    say!("{}", line.trim_end());
}

/// Every field of a block: its range, its roughness, and how much of it the data determine; then the parameters that are the
/// same at all pixels.
fn print_fields(result: &Calibrated, block: &Block) {
    let Some(layout) = block.piece().and_then(|p| p.field()) else { return };
    for field in result.smoothness.fields.iter().filter(|f| f.piece == block.name()) {
        let values = || indices(&layout, field.index).map(|i| block.theta[i]);
        let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let effective = field.effective.map_or_else(String::new, |e| format!(", {} effective parameters", number(e)));
        say!(
            "  {:6} {}  {} nodes with data{effective}, roughness {}; {} without data stay neutral",
            field.field,
            interval(least, most, ""),
            field.nodes,
            number(field.roughness),
            field.untouched
        );
    }
    for i in layout.parameter_count() - layout.shared..layout.parameter_count() {
        print_parameter(&block.parameters()[i], &measured(block.theta[i], None), "");
    }
}

/// Parameters with standard deviations, and how the fit went.
fn print_parameters(result: &Calibrated) {
    let stds = result.std_devs();
    for (block, range) in result.camera.blocks_with_ranges() {
        say!("{}", block.name());
        if block.theta.len() > MOST_PRINTED {
            print_fields(result, block);
            continue;
        }
        let parameters = block.parameters().iter().zip(&block.theta).zip(&block.free).zip(&stds[range]);
        for (((parameter, value), free), std) in parameters {
            let shown = measured(*value, *std);
            print_parameter(parameter, &shown, if *free { "no std. dev." } else { "fixed" });
        }
    }
    let noise = &result.noise;
    let depth = if result.with_depth {
        let (a, b) = (number(noise.depth.a_per_mm), number(noise.depth.b_mm));
        format!("; of inverse depth ρ: σ² = ({a}/mm)² + ({b} mm · ρ²)²")
    } else {
        String::new()
    };
    say!("noise of a marker: {} per coordinate{depth}", quantity(noise.pixel_sigma, "px"));
    if noise.planes.of_noise > 0.0 {
        let size = number(noise.planes.of_noise);
        say!(
            "frames have planes of their own, {size} times a pixel's noise; standard deviations of parameters cover them"
        );
    }
    let wrong: usize = result.capture.frames.iter().map(|f| f.wrong_markers.len()).sum();
    if wrong > 0 {
        say!("{} left out: more than a pixel from the fit", count(wrong, "marker"));
    }
    let samples: usize = result.capture.frames.iter().map(|f| f.samples.len()).sum();
    let apart = result.correlation_length_px.unwrap_or(1);
    say!(
        "{}, {} at least {apart} px apart ({} excluded); {} after {}",
        count(result.capture.frames.len(), "frame"),
        count(samples, "depth pixel"),
        count(result.outliers, "outlier"),
        result.termination,
        count(result.iterations, "iteration")
    );
    for frame in &result.capture.dropped {
        say!("not used: {} ({})", frame.name, frame.reason);
    }
}
