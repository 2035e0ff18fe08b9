//! A unit: what its calibration and the scores next to it say, in terms that can be compared between units.

use std::collections::BTreeMap;
use std::fmt::Write;

use depthcal_io::{Calibration, PieceRecord, ScoredEffect, Scores};
use depthcal_model::{FormulaDefinition, Of, On, Register, Role};
use nalgebra::{DMatrix, DVector};

use crate::conditions::Conditions;
use crate::depth_effect::DepthEffect;
use crate::random_effects::UnitEstimate;
use crate::scaled::{Scaled, part, picked};

/// Ridge, as a share of the information, with which combinations of an effect's parameters that a unit leaves undetermined get a
/// large, finite variance.
const RIDGE: f64 = 1e-9;

/// An effect with its constants, place and form: what has to be the same for values to be comparable.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectKey {
    /// Name of the piece.
    pub name: String,
    /// Constants by name.
    pub options: BTreeMap<String, f64>,
    /// State from which it takes its covariates.
    pub of: Of,
    /// The quantity that its shape is added to.
    pub on: Option<On>,
    /// The definition of a formula.
    pub formula: Option<FormulaDefinition>,
}

/// An effect that a unit's model has, or of which it has scores.
#[derive(Debug, Clone)]
pub struct UnitEffect {
    /// The effect.
    pub key: EffectKey,
    /// As given to `calibrate --with`.
    pub with: String,
    /// Names of its free parameters, `piece.parameter`.
    pub names: Vec<String>,
    /// Their nominal values.
    pub nominal: Vec<f64>,
    /// Whether the model has it.
    pub in_model: bool,
    /// Scatter of the frames' scores, where it was scored.
    pub scatter: Option<DMatrix<f64>>,
    /// Mean square over the observations as a quadratic form, mm², where it was scored.
    pub square_mm2: Option<DMatrix<f64>>,
    /// Its effect on depth; `None` where the model lacks it, and of effects that do not act on depth.
    pub on_depth: Option<DepthEffect>,
}

/// A parameter of a unit's model.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitParameter {
    /// Name, `piece.parameter`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value at which it does nothing; `None` for the pinhole.
    pub nominal: Option<f64>,
}

/// A unit.
#[derive(Debug, Clone)]
pub struct Unit {
    /// Its name.
    pub name: String,
    /// The calibration's path, for people.
    pub calibration: String,
    /// Digest of the dataset.
    pub digest: String,
    /// Size of the image, px.
    pub size: [usize; 2],
    /// Number of fitted frames.
    pub frames: usize,
    /// Root mean square of the depth residuals, mm; `None` without depth.
    pub depth_rms_mm: Option<f64>,
    /// Root mean square of the reprojection errors, px; `None` without images.
    pub reprojection_rms_px: Option<f64>,
    /// The free parameters with a covariance.
    pub parameters: Vec<UnitParameter>,
    /// Estimate and covariance of these.
    pub estimate: UnitEstimate,
    /// Under which conditions it was calibrated.
    pub conditions: Conditions,
    /// Effects in the model, and those that were scored.
    pub effects: Vec<UnitEffect>,
    /// Scores of the effects that the model lacks.
    pub scores: Option<UnitScores>,
}

/// Scores in terms of matrices.
#[derive(Debug, Clone)]
pub struct UnitScores {
    /// Names of all parameters.
    pub names: Vec<String>,
    /// Nominal values.
    pub nominal: DVector<f64>,
    /// U.
    pub score: DVector<f64>,
    /// V.
    pub information: DMatrix<f64>,
    /// Change of the unit's parameters per unit of a scored parameter: one row per entry of [`Unit::parameters`].
    pub response: DMatrix<f64>,
}

impl Unit {
    /// A unit from its records. `register` tells effects from the parts that every camera has, and nominal values. `None` where
    /// the calibration has no covariance, as from estimators other than the joint one.
    pub fn new(
        name: &str,
        path: &str,
        calibration: &Calibration,
        scores: Option<&Scores>,
        register: &Register,
    ) -> Option<Self> {
        let covariance = calibration.covariance.as_ref()?;
        let (mut parameters, mut values, mut effects) = (Vec::new(), Vec::new(), Vec::new());
        for piece in &calibration.camera.pieces {
            let known = Known::of(piece, register);
            let mut named = Vec::new();
            for p in piece.parameters.iter().filter(|p| !p.fixed) {
                let name = format!("{}.{}", piece.name, p.name);
                if covariance.parameters.contains(&name) {
                    let nominal = known.nominal(&p.name);
                    named.push((name.clone(), nominal.unwrap_or(0.0)));
                    parameters.push(UnitParameter { name, unit: p.unit.clone(), nominal });
                    values.push(p.value);
                }
            }
            if known.is_effect && !named.is_empty() {
                let (names, nominal) = named.into_iter().unzip();
                let key = EffectKey::of_piece(piece);
                let with = key.with(&known.default_options);
                let (scatter, square_mm2, in_model) = (None, None, true);
                let on_depth = DepthEffect::of(calibration, piece, register);
                effects.push(UnitEffect { key, with, names, nominal, in_model, scatter, square_mm2, on_depth });
            }
        }
        let rows: Vec<usize> = parameters
            .iter()
            .map(|p| covariance.parameters.iter().position(|name| *name == p.name))
            .collect::<Option<_>>()?;
        let n = rows.len();
        let covariance = DMatrix::from_fn(n, n, |i, k| {
            0.5 * (covariance.matrix[rows[i]][rows[k]] + covariance.matrix[rows[k]][rows[i]])
        });
        let mut unit = Self {
            name: name.to_owned(),
            calibration: path.to_owned(),
            digest: calibration.dataset.digest.clone(),
            size: [calibration.camera.width, calibration.camera.height],
            frames: calibration.fit.frames_used,
            depth_rms_mm: calibration.fit.depth_rms_mm,
            reprojection_rms_px: Some(calibration.fit.reprojection_rms_px).filter(|rms| *rms > 0.0),
            parameters,
            estimate: UnitEstimate { value: DVector::from_vec(values), covariance },
            conditions: Conditions::of(calibration),
            effects,
            scores: None,
        };
        if let Some(scores) = scores {
            unit.add_scores(scores);
        }
        Some(unit)
    }

    fn add_scores(&mut self, scores: &Scores) {
        let matrix =
            |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |i, k| rows[i][k]);
        let (mut names, mut nominal) = (Vec::new(), Vec::new());
        for effect in &scores.effects {
            let parameter_names: Vec<String> =
                effect.parameters.iter().map(|p| format!("{}.{}", effect.effect, p.name)).collect();
            let at_rest: Vec<f64> = effect.parameters.iter().map(|p| p.nominal).collect();
            self.effects.push(UnitEffect {
                key: EffectKey::of_scored(effect),
                with: effect.with.clone(),
                names: parameter_names.clone(),
                nominal: at_rest.clone(),
                in_model: false,
                scatter: Some(matrix(&effect.scatter)),
                square_mm2: Some(matrix(&effect.square_mm2)),
                on_depth: None,
            });
            names.extend(parameter_names);
            nominal.extend(at_rest);
        }
        let response = matrix(&scores.response);
        let row = |p: &UnitParameter| scores.model.iter().position(|value| value.name == p.name);
        let rows: Vec<Option<usize>> = self.parameters.iter().map(row).collect();
        let response = DMatrix::from_fn(rows.len(), names.len(), |i, k| rows[i].map_or(0.0, |r| response[(r, k)]));
        self.scores = Some(UnitScores {
            names,
            nominal: DVector::from_vec(nominal),
            score: DVector::from_column_slice(&scores.score),
            information: matrix(&scores.information),
            response,
        });
    }

    /// The effect with this key.
    pub fn effect(&self, key: &EffectKey) -> Option<&UnitEffect> {
        self.effects.iter().find(|effect| effect.key == *key)
    }

    /// The unit's estimate of parameters when the effects in `free` are free as well as its own model, and all other effects are
    /// nominal: effects that the model lacks by one step from their scores, whose variances are multiplied by `overdispersion`;
    /// effects that it has and `free` does not by conditioning on their nominal values. `None` where the unit neither has nor
    /// scored one of them, lacks a parameter, or does not determine it.
    pub fn estimate_with(&self, target: &[String], free: &[&EffectKey], overdispersion: f64) -> Option<UnitEstimate> {
        let wanted: Vec<&UnitEffect> = free.iter().map(|key| self.effect(key)).collect::<Option<_>>()?;
        let mut names: Vec<&String> = self.parameters.iter().map(|p| &p.name).collect();
        let UnitEstimate { mut value, mut covariance } = self.estimate.clone();
        let added: Vec<&String> = wanted.iter().filter(|e| !e.in_model).flat_map(|e| &e.names).collect();
        if !added.is_empty() {
            let scores = self.scores.as_ref()?;
            let places: Vec<usize> =
                added.iter().map(|name| scores.names.iter().position(|n| n == *name)).collect::<Option<_>>()?;
            let information = part(&scores.information, &places, &places);
            let inverse = Scaled::with_ridge(&information, RIDGE)?.inverse();
            let step = &inverse * picked(&scores.score, &places);
            let of_step = inverse * overdispersion;
            let all: Vec<usize> = (0..names.len()).collect();
            let response = part(&scores.response, &all, &places);
            let n = names.len();
            let mut extended = DMatrix::zeros(n + places.len(), n + places.len());
            let cross = &response * &of_step;
            extended.view_mut((0, 0), (n, n)).copy_from(&(covariance + &cross * response.transpose()));
            extended.view_mut((0, n), cross.shape()).copy_from(&cross);
            extended.view_mut((n, 0), (places.len(), n)).copy_from(&cross.transpose());
            extended.view_mut((n, n), of_step.shape()).copy_from(&of_step);
            covariance = extended;
            let moved = value + response * &step;
            let rested = picked(&scores.nominal, &places) + step;
            value = DVector::from_iterator(n + places.len(), moved.iter().chain(rested.iter()).copied());
            names.extend(added);
        }
        let at_rest = self.effects.iter().filter(|e| e.in_model && !free.contains(&&e.key));
        let (mut held, mut nominal) = (Vec::new(), Vec::new());
        for effect in at_rest {
            for (name, value) in effect.names.iter().zip(&effect.nominal) {
                // An effect that all units have is among the parameters that are asked for.
                if !target.contains(name) {
                    held.push(names.iter().position(|n| *n == name)?);
                    nominal.push(*value);
                }
            }
        }
        let places: Vec<usize> =
            target.iter().map(|name| names.iter().position(|n| *n == name)).collect::<Option<_>>()?;
        let mut estimate =
            UnitEstimate { value: picked(&value, &places), covariance: part(&covariance, &places, &places) };
        if !held.is_empty() {
            let of_rest = Scaled::new(&part(&covariance, &held, &held))?.inverse();
            let gain = part(&covariance, &places, &held) * of_rest;
            let departure = picked(&value, &held) - DVector::from_vec(nominal);
            estimate.value -= &gain * departure;
            estimate.covariance -= &gain * part(&covariance, &held, &places);
        }
        let finite = estimate.value.iter().chain(estimate.covariance.iter()).all(|v| v.is_finite());
        finite.then_some(estimate)
    }
}

/// Properties of a piece from the register.
struct Known {
    is_effect: bool,
    nominal: BTreeMap<String, f64>,
    default_options: BTreeMap<String, f64>,
}

impl Known {
    fn of(piece: &PieceRecord, register: &Register) -> Self {
        if let Some(definition) = &piece.formula {
            let nominal = definition.parameters.iter().map(|(name, p)| (name.clone(), p.table().nominal)).collect();
            return Self { is_effect: true, nominal, default_options: piece.options.clone() };
        }
        match register.find(&piece.name) {
            Some(known) => Self {
                is_effect: known.role() == Role::Effect,
                nominal: known.parameters().iter().map(|p| (p.name.to_string(), p.nominal)).collect(),
                default_options: known.options(),
            },
            None => Self { is_effect: false, nominal: BTreeMap::new(), default_options: BTreeMap::new() },
        }
    }

    fn nominal(&self, parameter: &str) -> Option<f64> {
        self.nominal.get(parameter).copied().filter(|v| v.is_finite())
    }
}

impl EffectKey {
    fn of_piece(piece: &PieceRecord) -> Self {
        Self {
            name: piece.name.clone(),
            options: piece.options.clone(),
            of: piece.of,
            on: piece.on,
            formula: piece.formula.clone(),
        }
    }

    fn of_scored(effect: &ScoredEffect) -> Self {
        Self {
            name: effect.effect.clone(),
            options: effect.options.clone(),
            of: effect.formula.as_ref().map_or_else(Of::default, |f| f.of),
            on: None,
            formula: effect.formula.clone(),
        }
    }

    /// As given to `calibrate --with`, constants included where they are not those in `default`.
    fn with(&self, default: &BTreeMap<String, f64>) -> String {
        let mut text = self.name.clone();
        for (name, value) in self.options.iter().filter(|(name, value)| default.get(*name) != Some(value)) {
            let _ = write!(text, "@{name}={value}");
        }
        text
    }
}
