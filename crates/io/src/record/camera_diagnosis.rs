//! The diagnosis of one camera: the effects that its model lacked, those that were added, and the errors before and after.

use depthcal_model::{FormulaDefinition, ModelSpec, Of, On, PieceSpec};
use serde::{Deserialize, Serialize};

use super::component::DiagnosisComponent;
use super::covariate::DiagnosisCovariate;
use super::decision::{DiagnosisDecision, DiagnosisRefuted};
use super::evaluation::Outliers;
use super::findings::{DiagnosisCapture, DiagnosisDeclaration, DiagnosisFrameCause, DiagnosisLeftOver};
use super::interval::Interval;
use super::pure_error::DiagnosisPureError;
use super::reference::FileReference;
use super::searched::DiagnosisSearched;

/// The outcome of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The data show nothing that the model lacks.
    Adequate,
    /// Named effects were added, and the data show nothing else.
    Effect,
    /// Something is left that no named effect explains; a free map may correct it.
    Unexplained,
}

/// Errors of one model on held-out frames. Errors of depth are absent when there is no depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct HeldOutErrors {
    /// Mean dot error, mm; see [`DatasetEvaluation`](super::evaluation::DatasetEvaluation).
    pub dot_error_mm: Option<f64>,
    /// Mean plane error, mm.
    pub plane_error_mm: Option<f64>,
    /// Root mean square of depth minus the board's depth, mm.
    pub depth_rms_mm: Option<f64>,
    /// Root mean square reprojection error, px; absent of a camera without images.
    pub reprojection_px: Option<f64>,
    /// Board pixels that are in none of the errors of depth; absent without depth and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outliers: Option<Outliers>,
}

/// A difference with its 95 % confidence interval from resampled frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct GainInterval {
    /// Estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl GainInterval {
    /// Whether the whole interval is above zero.
    pub fn is_certain(&self) -> bool {
        self.low > 0.0
    }
}

/// An effect that was accepted and added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisStep {
    /// Names of effects that explain the residuals jointly, in descending order of gain; the first is the one added.
    pub effects: Vec<String>,
    /// Names of effects that these captures cannot distinguish from it.
    pub indistinguishable: Vec<String>,
    /// Names of effects that only cameras of another technology have, and that explain a part of the same; none where the dataset
    /// declares `technology`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub of_other_technologies: Vec<String>,
    /// The effect as given to `calibrate --with`, constants included.
    #[schemars(with = "String")]
    pub with: PieceSpec,
    /// Where and how it acts, for an effect of depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<DiagnosisPlace>,
    /// Its other places and forms that these captures cannot distinguish from this one.
    #[serde(default)]
    pub places_not_told_apart: Vec<DiagnosisPlace>,
    /// Its fitted parameters.
    pub parameters: Vec<DiagnosisParameter>,
    /// Root mean square over the observations of what other parameters of the model do not compensate of the effect, mm.
    pub size_mm: f64,
    /// p-value of the score test, corrected for the number of effects tested.
    pub p_value: f64,
    /// Held-out errors before it was added.
    pub before: HeldOutErrors,
    /// Held-out errors after it was added.
    pub after: HeldOutErrors,
    /// Held-out root mean square depth error after it was added, with its interval; absent without depth and in files
    /// of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_after_mm: Option<Interval>,
    /// Decrease of the held-out root mean square depth error from `before` to `after`, per cent.
    pub depth_gain_percent: Option<GainInterval>,
    /// Decrease of the error on left-out frames through it, given all other effects of the last model, per cent: of the product
    /// of the depth error weighted by its noise and of the reprojection error, the less certain one with frames left out singly
    /// and in blocks; absent for a free map and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_percent: Option<GainInterval>,
    /// Evidence for it, where it is a formula that was found in the residuals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<DiagnosisFormula>,
}

impl CameraDiagnosis {
    /// Whether nothing is left, and only that makes the verdict `unexplained` that something was added whose cause is not known.
    pub fn lacks_only_causes(&self) -> bool {
        let is_description = |step: &DiagnosisStep| step.formula.as_ref().is_some_and(|formula| !formula.confirmed);
        self.verdict == Verdict::Unexplained && self.left_over.is_empty() && self.steps.iter().any(is_description)
    }
}

impl DiagnosisStep {
    /// The decrease of the error by which it is judged: given all other effects or, where that is not known, from `before` to
    /// `after`.
    pub fn gain(&self) -> Option<GainInterval> {
        self.gain_percent.or(self.depth_gain_percent)
    }

    /// Its parameters that are no coefficients of a spline, and the coefficients of each spline.
    pub fn parameters_and_splines(&self) -> (Vec<&DiagnosisParameter>, Vec<Vec<&DiagnosisParameter>>) {
        let smooth = self.formula.iter().flat_map(|formula| &formula.definition.smooth);
        let named = |name: &String| self.parameters.iter().find(|parameter| parameter.name == *name);
        let splines: Vec<Vec<&DiagnosisParameter>> = smooth
            .map(|function| function.parameters.iter().filter_map(named).collect())
            .filter(|s: &Vec<_>| s.len() > 1)
            .collect();
        let is_single =
            |parameter: &&DiagnosisParameter| !splines.iter().flatten().any(|other| other.name == parameter.name);
        (self.parameters.iter().filter(is_single).collect(), splines)
    }
}

impl DiagnosisFormula {
    /// Whether it is a smooth function without a name, rather than a formula of few parameters.
    pub fn is_smooth_function(&self) -> bool {
        !self.definition.smooth.is_empty()
    }
}

/// A formula that was found in the residuals: a description of what is left, not its cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisFormula {
    /// The formula, in terms of its covariates, parameters and constants.
    pub expression: String,
    /// Names of its covariates, sorted.
    pub covariates: Vec<String>,
    /// Covariates that may stand for one of these: the frames do not tell which of the two it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub covariates_not_told_apart: Vec<DiagnosisExchange>,
    /// Place and form.
    pub place: DiagnosisPlace,
    /// Share of resamples of the frames in which the best of all terms has these covariates, or ones that are not told apart from
    /// them.
    pub stability: f64,
    /// Whether frames that the search did not see confirm sign and size; else it is a candidate.
    pub confirmed: bool,
    /// Effects of the catalogue that explain nearly as much.
    pub resembles: Vec<String>,
    /// Size in the frames that were set aside over that in the others; absent where it cannot be estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub replication: Option<DiagnosisReplication>,
    /// Share that it explains of what the best free function of its covariates explains, on left-out frames.
    pub share_of_free_function: f64,
    /// Number of terms that were scored.
    pub terms: usize,
    /// Effects of the catalogue that it took the place of, because it predicts left-out frames better than they do together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub replaced: Vec<String>,
    /// The best formulas of other covariates.
    pub runners_up: Vec<DiagnosisRunnerUp>,
    /// The parts of the residuals that it describes; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub components: Vec<DiagnosisComponent>,
    /// The effect whole, as `--with` takes it in a file.
    pub definition: FormulaDefinition,
}

/// Two covariates that rise and fall together in the frames, such as time and temperature while a camera warms up.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisExchange {
    /// The covariate of the formula.
    pub covariate: String,
    /// The one that explains as much in its place.
    pub instead: String,
}

/// The size of an effect in frames that were set aside, over that in the others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisReplication {
    /// 1 where both have the same size.
    pub size: f64,
    /// Its standard error, over frames.
    pub standard_error: f64,
}

/// A formula that lost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisRunnerUp {
    /// The formula.
    pub expression: String,
    /// Names of its covariates, sorted.
    pub covariates: Vec<String>,
    /// Its gain on left-out frames over that of the best formula.
    pub gain_share: f64,
}

/// Place and form of an effect of depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisPlace {
    /// The state from which it takes its covariates.
    pub of: Of,
    /// The quantity that its shape is added to.
    pub on: On,
}

/// A fitted parameter of an added effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisParameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Standard deviation; absent when the parameter is held or not determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
}

/// An effect that seems to be missing, but that these captures do not prove: it is not added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisPossible {
    /// Its name.
    pub effect: String,
    /// The effect as given to `calibrate --with`, constants included.
    #[schemars(with = "String")]
    pub with: PieceSpec,
    /// Decrease of the weighted error on left-out frames, per cent.
    pub gain_percent: GainInterval,
    /// Number of further frames like these with which the gain, if it is real, would be certain; absent where the reason is
    /// another: an error that users read would rise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub further_frames: Option<u64>,
}

/// The score test of an effect or free function that a round's model does not have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisCandidate {
    /// Its name.
    pub effect: String,
    /// Covariate of a free function; absent of effects, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<DiagnosisCovariate>,
    /// p-value of the score test, corrected for the number of values tried for its constant.
    pub p_value: f64,
    /// Root mean square size at the parameters that the data give it, less what fitted parameters compensate, mm; absent when
    /// these captures do not determine them.
    pub expected_size_mm: Option<f64>,
    /// Smallest such size that these captures reveal with 80 % power at the 1 % level, mm; absent when they reveal none.
    pub minimal_detectable_mm: Option<f64>,
    /// Decrease of the weighted root mean square residual on left-out frames, per cent; negative when it rises.
    pub held_out_gain_percent: f64,
}

/// One round of a diagnosis: the tests of everything that its model lacks, and the decision.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisRound {
    /// Effects, in descending order of gain.
    pub effects: Vec<DiagnosisCandidate>,
    /// Free functions of a covariate, in descending order of gain. They compete with the effects and name nothing.
    pub free: Vec<DiagnosisCandidate>,
    /// Effects that the decision disregards.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refuted: Vec<DiagnosisRefuted>,
    /// The decision, and what became of it.
    pub decision: DiagnosisDecision,
}

/// A frame that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisFrame {
    /// Its name.
    pub name: String,
    /// Why it was left out.
    pub cause: DiagnosisFrameCause,
}

/// The plane by which a frame's depth, corrected by the last model, deviates from the pose that its image gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisFramePlane {
    /// Name of the frame.
    pub name: String,
    /// Mean over the frame's depth samples, mm.
    pub offset_mm: f64,
    /// Root mean square over the frame's depth samples, mm.
    pub rms_mm: f64,
    /// p-value of the hypothesis that the plane is noise.
    pub p_value: f64,
}

/// How similar effects are to each other on these captures, given the declared model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Separability {
    /// Names of the effects; those that were added come first.
    pub effects: Vec<String>,
    /// Row i, column k: cosine of the angle between effect i, at the parameters that the data give it, and the space
    /// that effect k spans, both projected off the declared model. At 1 effect k can reproduce effect i; at 0 they are
    /// orthogonal.
    pub mimicry: Vec<Vec<f64>>,
}

/// Held-out errors of the first and the last model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisHeldOut {
    /// The declared model.
    pub before: HeldOutErrors,
    /// The last model.
    pub after: HeldOutErrors,
}

/// The diagnosis of one camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CameraDiagnosis {
    /// The dataset.
    pub dataset: FileReference,
    /// The declared depth model.
    #[schemars(with = "String")]
    pub model: ModelSpec,
    /// The outcome.
    pub verdict: Verdict,
    /// The effects that were added, in order.
    pub steps: Vec<DiagnosisStep>,
    /// Effects that may be missing too, but are not certain; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub possible: Vec<DiagnosisPossible>,
    /// Errors of the last model, and the pure error; absent where it cannot be told, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pure_error: Option<DiagnosisPureError>,
    /// Tests of the first round, whose model is the declared one: every effect, and the free map, in descending order
    /// of gain.
    pub candidates: Vec<DiagnosisCandidate>,
    /// The tests of every round, with all free functions, and its decision.
    #[serde(default)]
    pub rounds: Vec<DiagnosisRound>,
    /// Frames that were left out.
    pub bad_frames: Vec<DiagnosisFrame>,
    /// Implausible declarations.
    #[serde(default)]
    pub declarations: Vec<DiagnosisDeclaration>,
    /// Structure left in the residuals that no effect explains.
    #[serde(default)]
    pub left_over: Vec<DiagnosisLeftOver>,
    /// The functions that were searched in what is left; absent where none were, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub searched: Option<DiagnosisSearched>,
    /// Why no formula was found for what is left; absent where none was searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula_refused: Option<String>,
    /// Captures that would help.
    #[serde(default)]
    pub capture_next: Vec<DiagnosisCapture>,
    /// The plane of every frame, given the last model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frame_planes: Vec<DiagnosisFramePlane>,
    /// How similar the effects are to each other on these captures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separability: Option<Separability>,
    /// Held-out errors of the first and the last model.
    pub held_out: DiagnosisHeldOut,
}
