//! Depth models compared on equal terms: one solver, one protocol, and data that no fit has seen.
//!
//! Every variant (a depth model, a lens model, an estimator) is fitted to the training dataset and judged on the others;
//! without others, on frames of the training dataset that each of several fits leaves out. What all variants share is done
//! once: the calibration of camera and lens from the images.

pub mod errors;
mod learning;
mod stability;
pub mod tables;

use std::collections::BTreeMap;

use depthcal_io::{Comparison, DatasetEvaluation, Errors, ModelComparison};
use depthcal_model::RegisterError;
use rayon::prelude::*;

use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, Estimator, calibrate_depth, calibrate_image};
use crate::judge::evaluate::{Evaluated, evaluate};
use crate::observe::{Capture, PosedFrame};
use errors::{FrameErrors, frame_errors, interval, resampled};

/// What to compare, and how.
#[derive(Debug, Clone)]
pub struct CompareOptions {
    /// Depth models, as `--model` takes them.
    pub models: Vec<String>,
    /// How each is calibrated; model, lens and estimator are set for each.
    pub calibrate: CalibrateOptions,
    /// Parts of the training frames that are left out in turn where no other dataset is given.
    pub folds: usize,
    /// The thesis' tables: all subsets of D, with and without lens, the four estimators, and D refitted to every dataset.
    pub thesis: bool,
    /// Numbers of frames of the learning curve; those that the training dataset does not have are left out.
    pub learning_sizes: Vec<usize>,
    /// Fits per number of frames.
    pub learning_fits: usize,
}

impl Default for CompareOptions {
    fn default() -> Self {
        Self {
            models: vec!["none".to_owned(), "projective:xw".to_owned(), "projective".to_owned()],
            calibrate: CalibrateOptions::default(),
            folds: 6,
            thesis: true,
            learning_sizes: vec![4, 6, 8, 12, 16, 24, 32, 48],
            learning_fits: 3,
        }
    }
}

/// A model with everything else that an entry of a table depends on.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Variant {
    /// The depth model.
    pub model: String,
    /// `brown-conrady` or `none`.
    pub lens: String,
    /// [`Estimator::name`].
    pub estimator: &'static str,
}

impl Variant {
    fn new(model: &str, lens: &str, estimator: Estimator) -> Self {
        Self { model: model.to_owned(), lens: lens.to_owned(), estimator: estimator.name() }
    }

    fn options(&self, base: &CalibrateOptions) -> CalibrateOptions {
        let all = [Estimator::Joint, Estimator::Linear, Estimator::Irls, Estimator::Nonlinear];
        let estimator = all.into_iter().find(|e| e.name() == self.estimator).unwrap_or_default();
        // Without depth model depth says nothing of the camera, and would only pull it away from the images.
        let estimator = if self.model == "none" { Estimator::Linear } else { estimator };
        CalibrateOptions { model: self.model.clone(), lens: self.lens.clone(), estimator, ..base.clone() }
    }
}

/// The subsets of D in the thesis' order, and the others: 16 with `none` and the whole.
pub fn subsets() -> Vec<String> {
    let letters = ["xyzw", "xyz", "xyw", "xzw", "yzw", "xy", "xz", "xw", "yz", "yw", "zw", "x", "y", "z", "w"];
    let name = |l: &&str| if *l == "xyzw" { "projective".to_owned() } else { format!("projective:{l}") };
    letters.iter().map(name).chain(["none".to_owned()]).collect()
}

/// Calibrations from the images alone, shared by all variants: by lens, one per set of frames.
struct Prepared {
    capture: Capture,
    by_lens: BTreeMap<String, Result<Calibrated<PosedFrame>, String>>,
}

impl Prepared {
    fn new(capture: Capture, lenses: &[&str], base: &CalibrateOptions) -> Self {
        let of = |lens: &&str| {
            let options = CalibrateOptions { lens: (*lens).to_owned(), ..base.clone() };
            ((*lens).to_owned(), calibrate_image(&capture, &options).map_err(|e| e.to_string()))
        };
        let by_lens = lenses.par_iter().map(of).collect();
        Self { capture, by_lens }
    }

    fn fit(&self, variant: &Variant, base: &CalibrateOptions) -> Result<Calibrated, String> {
        let image = self.by_lens.get(&variant.lens).cloned().unwrap_or_else(|| Err("no such lens".to_owned()))?;
        calibrate_depth(image, &variant.options(base)).map_err(|e: CalibrateError| e.to_string())
    }
}

/// A variant, fitted and judged.
struct Judged {
    record: ModelComparison,
    held: Vec<Vec<FrameErrors>>,
    criteria: Option<[f64; 2]>,
}

/// Compares depth models.
///
/// # Errors
///
/// [`RegisterError`] where a model's name is wrong. Models that cannot be fitted are listed with the reason.
pub fn compare(train: &Capture, verify: &[Capture], options: &CompareOptions) -> Result<Comparison, RegisterError> {
    let base = &options.calibrate;
    for model in &options.models {
        base.register.depth_model(model)?;
    }
    let mut variants: Vec<Variant> =
        options.models.iter().map(|m| Variant::new(m, &base.lens, Estimator::Joint)).collect();
    let listed = variants.len();
    if options.thesis {
        variants.extend(thesis_variants());
        let mut seen = std::collections::BTreeSet::new();
        variants.retain(|v| seen.insert(v.clone()));
    }
    let mut lenses: Vec<&str> = variants.iter().map(|v| v.lens.as_str()).collect();
    lenses.sort_unstable();
    lenses.dedup();
    let whole = Prepared::new(train.clone(), &lenses, base);
    // Without other datasets every frame is judged by a fit that did not see it.
    let folds: Vec<(Prepared, Capture)> = if verify.is_empty() {
        let part = |fold: usize| {
            let rest = train.subset(|i, _| i % options.folds != fold);
            (Prepared::new(rest, &lenses, base), train.subset(|i, _| i % options.folds == fold))
        };
        (0..options.folds).into_par_iter().map(part).collect()
    } else {
        Vec::new()
    };
    let job = base.progress.steps("fitting models", variants.len());
    let judged = variants.par_iter().map(|v| {
        let judged = judge(v, &whole, &folds, verify, base);
        job.advance();
        judged
    });
    let judged: Vec<Judged> = judged.collect();
    drop(job);
    let (models, variants) = rank(judged, listed);
    let mut comparison = Comparison {
        train: train.name.clone(),
        verify: verify.iter().map(|c| c.name.clone()).collect(),
        verdict: verdict(&models),
        models,
        variants,
        learning_curve: learning::curve(train, verify, options),
        stability: None,
    };
    if options.thesis && !verify.is_empty() {
        comparison.stability = stability::stability(train, verify, &whole, base);
    }
    Ok(comparison)
}

/// What the thesis' tables need beside the models asked for.
fn thesis_variants() -> Vec<Variant> {
    let mut variants = Vec::new();
    for estimator in [Estimator::Nonlinear, Estimator::Joint] {
        variants.extend(subsets().iter().map(|m| Variant::new(m, "brown-conrady", estimator)));
        variants.push(Variant::new("projective", "none", estimator));
    }
    for estimator in [Estimator::Linear, Estimator::Irls] {
        for model in ["projective", "projective:xw"] {
            variants.push(Variant::new(model, "brown-conrady", estimator));
        }
    }
    variants
}

fn judge(
    variant: &Variant,
    whole: &Prepared,
    folds: &[(Prepared, Capture)],
    verify: &[Capture],
    base: &CalibrateOptions,
) -> Judged {
    let mut record = ModelComparison {
        model: variant.model.clone(),
        lens: variant.lens.clone(),
        estimator: variant.estimator.to_owned(),
        ..ModelComparison::default()
    };
    match judge_fit(variant, whole, folds, verify, base, &mut record) {
        Ok((held, criteria)) => Judged { record, held, criteria },
        Err(reason) => {
            record.failed = Some(reason);
            Judged { record, held: Vec::new(), criteria: None }
        }
    }
}

type Held = (Vec<Vec<FrameErrors>>, Option<[f64; 2]>);

fn judge_fit(
    variant: &Variant,
    whole: &Prepared,
    folds: &[(Prepared, Capture)],
    verify: &[Capture],
    base: &CalibrateOptions,
    record: &mut ModelComparison,
) -> Result<Held, String> {
    let fitted = whole.fit(variant, base)?;
    record.parameters = fitted.camera.blocks().iter().map(|b| b.free.iter().filter(|f| **f).count()).sum();
    record.effective_parameters = effective_parameters(&fitted);
    let on_train = evaluate(&fitted.camera, &whole.capture);
    record.fit = errors::errors(&[frame_errors(&on_train)]);
    let mut evaluations = vec![on_train];
    if folds.is_empty() {
        evaluations.extend(verify.par_iter().map(|c| evaluate(&fitted.camera, c)).collect::<Vec<_>>());
    } else {
        let parts: Result<Vec<Evaluated>, String> =
            folds.par_iter().map(|(rest, left)| Ok(evaluate(&rest.fit(variant, base)?.camera, left))).collect();
        let name = format!("{} (frames left out)", whole.capture.name);
        let mut all = Evaluated { name, frames: Vec::new(), dropped: Vec::new() };
        for part in parts? {
            all.frames.extend(part.frames);
            all.dropped.extend(part.dropped);
        }
        all.frames.sort_by(|a, b| a.name.cmp(&b.name));
        evaluations.push(all);
    }
    record.per_dataset =
        evaluations.iter().map(|e| DatasetEvaluation { frames_detail: Vec::new(), ..e.record() }).collect();
    let held: Vec<Vec<FrameErrors>> = evaluations[1..].iter().map(frame_errors).collect();
    let [refused, all] =
        held.iter().flatten().fold([0, 0], |[r, a], f| [r + f.uncorrectable[0], a + f.uncorrectable[1]]);
    record.not_correctable = refused as f64 / all.max(1) as f64;
    Ok((held, criteria(&fitted, record.effective_parameters)))
}

/// Free parameters of camera, lens and depth model; of fields, what the data rather than the prior determine.
fn effective_parameters(fitted: &Calibrated) -> f64 {
    let fields = &fitted.smoothness.fields;
    let blocks = fitted.camera.blocks().iter().map(|block| {
        let free = block.free.iter().filter(|f| **f).count() as f64;
        let own = fields.iter().filter(|f| f.piece == block.name());
        own.fold(free, |count, f| count - f.nodes as f64 + f.effective.unwrap_or(f.nodes as f64))
    });
    blocks.sum()
}

/// Akaike's and Schwarz' criteria per residual of the joint adjustment, times a common number: −2 ln L + 2 k and
/// −2 ln L + k ln n. They take residuals for independent, which pixels of a frame are not, and so favour large models.
fn criteria(fitted: &Calibrated, effective: f64) -> Option<[f64; 2]> {
    if fitted.estimator != Estimator::Joint || !fitted.with_depth {
        return None;
    }
    let depths = fitted.capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| 1.0 / s.depth_mm));
    let (sum, n) = depths.fold((0.0, 0), |(s, n), rho| (s + fitted.noise.depth.sigma(rho).ln(), n + 1));
    let markers: usize = fitted.capture.frames.iter().map(|f| f.markers.len()).sum();
    let deviance = 2.0 * fitted.cost + 2.0 * sum + 4.0 * markers as f64 * fitted.noise.pixel_sigma.ln();
    let rows = (n + 2 * markers) as f64;
    Some([2.0 * effective, effective * rows.ln()].map(|penalty| deviance + penalty))
}

/// Intervals for all, the listed models best first.
fn rank(judged: Vec<Judged>, listed: usize) -> (Vec<ModelComparison>, Vec<ModelComparison>) {
    let good: Vec<usize> = (0..judged.len()).filter(|i| judged[*i].record.failed.is_none()).collect();
    let held: Vec<&[Vec<FrameErrors>]> = good.iter().map(|i| judged[*i].held.as_slice()).collect();
    let mut results: BTreeMap<usize, (Errors<_>, Vec<f64>)> = good.iter().copied().zip(resampled(&held)).collect();
    let error =
        |e: &Errors<Option<depthcal_io::Interval>>| e.dot_error_mm.or(e.depth_rms_mm).map_or(f64::INFINITY, |i| i.mean);
    let best = (0..listed)
        .filter_map(|i| results.get(&i).map(|r| (i, error(&r.0))))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, value)| (results[&i].1.clone(), value));
    let mut least = [f64::INFINITY; 2];
    for judged in judged[..listed].iter().filter_map(|j| j.criteria) {
        least = [0, 1].map(|k| least[k].min(judged[k]));
    }
    // Every model is compared with the best: the chance of calling any difference real that is none stays at 5 %.
    let outside = 0.05 / (listed.max(2) - 1) as f64;
    let mut records: Vec<ModelComparison> = judged
        .into_iter()
        .enumerate()
        .map(|(i, judged)| {
            let mut record = judged.record;
            let Some((held_out, samples)) = results.remove(&i) else { return record };
            record.held_out = held_out;
            [record.aic, record.bic] = match judged.criteria {
                Some(c) if least[0].is_finite() => [Some(c[0] - least[0]), Some(c[1] - least[1])],
                _ => [None; 2],
            };
            if let Some((reference, value)) = &best {
                let difference: Vec<f64> = samples.iter().zip(reference).map(|(a, b)| a - b).collect();
                let mean = error(&held_out) - value;
                record.worse_than_best_mm = Some(interval(mean, difference.clone(), 0.05));
                record.really_worse = mean > 0.0 && interval(mean, difference, outside).low > 0.0;
            }
            record
        })
        .collect();
    let variants = records.clone();
    records.truncate(listed);
    records.sort_by(|a, b| {
        let key = |m: &ModelComparison| if m.failed.is_some() { f64::INFINITY } else { error(&m.held_out) };
        key(a).total_cmp(&key(b))
    });
    (records, variants)
}

/// What the ranking says, in sentences.
fn verdict(models: &[ModelComparison]) -> Vec<String> {
    let mut sentences = Vec::new();
    let Some(best) = models.first().filter(|m| m.failed.is_none()) else {
        return vec!["No model could be fitted.".to_owned()];
    };
    let error = |m: &ModelComparison| m.held_out.dot_error_mm.or(m.held_out.depth_rms_mm);
    if let Some(e) = error(best) {
        sentences.push(format!(
            "'{}' has the smallest error on data that it did not see: {:.2} mm ({:.2} to {:.2}).",
            best.model, e.mean, e.low, e.high
        ));
    }
    let equal: Vec<&ModelComparison> = models.iter().filter(|m| m.failed.is_none() && !m.really_worse).collect();
    if equal.len() > 1 {
        let names: Vec<String> = equal.iter().map(|m| format!("'{}'", m.model)).collect();
        sentences.push(format!("These frames cannot tell apart: {}.", names.join(", ")));
    }
    // Effective numbers that differ by less than one parameter say nothing; of those the one that has fewest at all.
    let least = equal.iter().map(|m| m.effective_parameters).fold(f64::INFINITY, f64::min);
    let simplest = equal.iter().filter(|m| m.effective_parameters < least + 1.0).min_by_key(|m| m.parameters);
    if let Some(simplest) = simplest {
        sentences.push(format!(
            "The simplest of them is '{}' with {:.1} effective parameters; use it unless another reason speaks for more.",
            simplest.model, simplest.effective_parameters
        ));
    }
    let worse: Vec<String> = models
        .iter()
        .filter(|m| m.really_worse)
        .filter_map(|m| {
            m.worse_than_best_mm.map(|d| format!("'{}' by {:.2} mm ({:.2} to {:.2})", m.model, d.mean, d.low, d.high))
        })
        .collect();
    if !worse.is_empty() {
        sentences.push(format!("Really worse than the best: {}.", worse.join("; ")));
    }
    for model in models {
        if let Some(reason) = &model.failed {
            sentences.push(format!("'{}' could not be fitted: {reason}.", model.model));
        }
    }
    sentences
}
