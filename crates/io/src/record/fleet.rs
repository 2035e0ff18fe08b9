//! `fleet.json`: what the calibrations of one camera type say together.

use serde::{Deserialize, Serialize};

use super::result_file::result_file;
use crate::file::{read_json, write_json};

/// Result of `depthcal fleet`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Fleet {
    /// The units.
    pub units: Vec<FleetUnit>,
    /// Calibrations that could not be joined with the others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<FleetLeftOut>,
    /// Level at which everything was tested, each family of tests as a whole.
    pub level: f64,
    /// The parameters that all units have.
    pub parameters: Vec<FleetParameter>,
    /// Covariance T of these parameters between units.
    pub between_units: Vec<Vec<f64>>,
    /// Covariance of their shared means.
    pub of_mean: Vec<Vec<f64>>,
    /// Number of common factors in T besides its diagonal.
    pub common_factors: usize,
    /// Effects that at least one unit's model lacks or has, by rising p-value.
    pub effects: Vec<FleetEffect>,
    /// Units that are unlike the others, the most certain first. They are in none of the means and variances.
    pub outliers: Vec<FleetOutlier>,
    /// Effects in the units' models, formulas included, compared between the units that have them.
    pub replications: Vec<FleetReplication>,
    /// Effects in the units' models with constants, places or forms of their own, compared by what they do to depth.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub on_depth: Vec<FleetOnDepth>,
}

result_file!(Fleet, "fleet.json", read_json, write_json);

/// A unit of a fleet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetUnit {
    /// Its name: that of the folder of its calibration.
    pub name: String,
    /// The calibration.
    pub calibration: String,
    /// Number of frames that were fitted.
    pub frames: usize,
    /// Root mean square of its depth residuals on these, mm; absent without depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<f64>,
    /// Root mean square of its reprojection errors, px; absent without images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reprojection_rms_px: Option<f64>,
    /// Whether scores of effects that its model lacks were found next to the calibration.
    pub has_scores: bool,
    /// p-value of its parameters' squared distance from what the other units predict, uncorrected.
    pub p_value: f64,
}

/// A calibration that could not be joined with the others.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetLeftOut {
    /// The calibration.
    pub calibration: String,
    /// Why.
    pub reason: String,
}

/// A parameter over all units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetParameter {
    /// Name, `piece.parameter`.
    pub name: String,
    /// Unit; `1` for a dimensionless parameter.
    pub unit: String,
    /// Value at which it does nothing, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal: Option<f64>,
    /// Shared mean μ.
    pub mean: f64,
    /// Standard deviation of the mean.
    pub mean_std_dev: f64,
    /// p-value of μ being nominal, corrected for the number of parameters (Holm); absent without a nominal value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shared_p_value: Option<f64>,
    /// Standard deviation between units, √T.
    pub between_units: f64,
    /// Standard deviation that noise alone makes between units: root mean square of the units' own standard deviations.
    pub of_noise: f64,
    /// p-value of units not differing, corrected for the number of parameters (Holm).
    pub differs_p_value: f64,
    /// The estimate of every unit.
    pub values: Vec<FleetUnitValue>,
}

/// An estimate of one unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetUnitValue {
    /// Number of the unit.
    pub unit: usize,
    /// Estimate from its own data.
    pub value: f64,
    /// Standard deviation of that.
    pub std_dev: f64,
    /// Estimate with the other units as prior (shrunken, best linear unbiased prediction).
    pub shrunken: f64,
}

/// An effect over all units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetEffect {
    /// Its name.
    pub effect: String,
    /// The effect as given to `calibrate --with`.
    pub with: String,
    /// Number of units that have it in their models.
    pub in_models: usize,
    /// Names of its parameters.
    pub parameters: Vec<String>,
    /// Shared mean of its parameters.
    pub mean: Vec<f64>,
    /// Standard deviations of the mean.
    pub mean_std_dev: Vec<f64>,
    /// Standard deviations between units.
    pub between_units: Vec<f64>,
    /// p-value of no shared effect, corrected for the number of effects (Holm).
    pub shared_p_value: f64,
    /// p-value of the units not differing in it, corrected for the number of effects (Holm).
    pub differs_p_value: f64,
    /// Whether it is found as shared: significant given the effects that were found before it.
    pub shared: bool,
    /// An effect that was found before it and explains what speaks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explained_by: Option<String>,
    /// Found effects that these units cannot tell from it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indistinguishable: Vec<String>,
    /// Root mean square over the observations of what other parameters do not compensate of the shared effect, mm; absent where
    /// no unit scored it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_mm: Option<f64>,
    /// Size of the shared effect as a multiple of what the median unit alone would show with 80 % power.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of_detectable: Option<f64>,
    /// Factor by which the scatter between frames exceeds the noise model, at least 1.
    pub overdispersion: f64,
    /// Estimates of every unit.
    pub units: Vec<FleetEffectUnit>,
}

/// Estimate of an effect from one unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetEffectUnit {
    /// Number of the unit.
    pub unit: usize,
    /// Whether its model has the effect; else the values are one step from the score.
    pub in_model: bool,
    /// Values of the parameters.
    pub values: Vec<f64>,
    /// Their standard deviations.
    pub std_dev: Vec<f64>,
}

/// A unit that is unlike the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetOutlier {
    /// Number of the unit.
    pub unit: usize,
    /// Its name.
    pub name: String,
    /// `model` for the parameters that all units have, else the name of an effect.
    pub within: String,
    /// p-value, corrected for the number of units and tests (Bonferroni).
    pub p_value: f64,
    /// The parameters that carry it, the most important first.
    pub parts: Vec<FleetOutlierPart>,
}

/// A parameter in which a unit is unlike the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetOutlierPart {
    /// Name, `piece.parameter`.
    pub parameter: String,
    /// Value of this unit.
    pub value: f64,
    /// Value that the other units predict.
    pub expected: f64,
    /// Departure given all other parameters of the unit, in standard deviations.
    pub standardized: f64,
}

/// An effect compared between units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetReplication {
    /// Its name.
    pub effect: String,
    /// The effect as given to `calibrate --with`.
    pub with: String,
    /// The formula, where it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<String>,
    /// Units whose models have it.
    pub found_in: Vec<String>,
    /// Units that scored it without having it in their models.
    pub tested_in: Vec<String>,
    /// Share of these other units in which it has the same sign as where it was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub same_sign: Option<f64>,
    /// Size in the other units over that where it was found; 1 where it repeats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_size: Option<f64>,
    /// Standard error of that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_size_std_dev: Option<f64>,
    /// p-value of no effect in the other units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
    /// Whether the other units confirm sign and size.
    pub confirmed: bool,
}

/// An effect that units have with constants, places or forms of their own, over image, distances, angles of incidence,
/// amplitudes, temperatures and times of all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetOnDepth {
    /// Its name.
    pub effect: String,
    /// Root mean square of what it does to depth on average over the units, mm.
    pub mean_mm: f64,
    /// The units that have it.
    pub units: Vec<FleetUnitOnDepth>,
}

/// Effect of a unit on depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FleetUnitOnDepth {
    /// The unit.
    pub name: String,
    /// The effect as given to `calibrate --with`.
    pub with: String,
    /// Root mean square of what it does to depth, mm.
    pub size_mm: f64,
    /// Root mean square of the difference from the mean of the other units, mm.
    pub difference_mm: f64,
    /// The difference that the uncertainties of all units give alone, mm.
    pub of_noise_mm: f64,
    /// p-value of the difference under these uncertainties.
    pub p_value: f64,
}
