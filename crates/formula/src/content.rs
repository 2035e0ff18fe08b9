//! A checked formula: what pieces, checks and prints are made from.

use std::collections::BTreeMap;

use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, FormulaDefinition, Options};

use crate::covariate::FormulaCovariate;
use crate::lowering::Meaning;
use crate::syntax::Expression;

/// A definition with what was found in its text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Content {
    pub definition: FormulaDefinition,
    pub adds_to: AddsTo,
    pub expressions: Vec<Expression>,
    /// In the order of [`FormulaCovariate::ALL`], quantities after them.
    pub covariates: Vec<FormulaCovariate>,
    /// As declared, or as the formula asks for.
    pub units_of_constants: BTreeMap<String, String>,
    /// Typical deviations of the parameters from nominal.
    pub scales: Vec<f64>,
}

/// Quantities that a formula may be added to at a hook, the usual one first, with the unit.
pub(crate) fn targets(hook: HookKind) -> &'static [(AddsTo, &'static str)] {
    match hook {
        HookKind::Depth => &[(AddsTo::Depth, "mm"), (AddsTo::InverseDepth, "1/mm"), (AddsTo::Factor, "1")],
        HookKind::Lens => &[(AddsTo::Factor, "1"), (AddsTo::X, "1"), (AddsTo::Y, "1"), (AddsTo::Xy, "1")],
        HookKind::Pixel => &[(AddsTo::Uv, "px"), (AddsTo::U, "px"), (AddsTo::V, "px")],
        HookKind::Board => &[(AddsTo::Z, "mm"), (AddsTo::X, "mm"), (AddsTo::Y, "mm")],
        HookKind::Pose => &[],
    }
}

/// The name of a target in files.
pub(crate) fn target_name(adds_to: AddsTo) -> &'static str {
    match adds_to {
        AddsTo::Depth => "depth",
        AddsTo::InverseDepth => "inverse_depth",
        AddsTo::Factor => "factor",
        AddsTo::X => "x",
        AddsTo::Y => "y",
        AddsTo::Xy => "xy",
        AddsTo::Z => "z",
        AddsTo::U => "u",
        AddsTo::V => "v",
        AddsTo::Uv => "uv",
    }
}

impl Content {
    /// Where it acts.
    pub fn hook(&self) -> HookKind {
        self.definition.hook
    }

    /// The effect in words.
    pub fn summary(&self) -> String {
        if !self.definition.summary.is_empty() {
            return self.definition.summary.clone();
        }
        let covariates: Vec<&str> = self.covariates.iter().map(|c| c.words()).collect();
        let what = match self.hook() {
            HookKind::Depth => "depth",
            HookKind::Lens => "the place in the image",
            HookKind::Pixel => "the place in the depth image",
            HookKind::Board | HookKind::Pose => "the board's shape",
        };
        match covariates.is_empty() {
            true => format!("{what} is shifted by a constant"),
            false => format!("{what} depends on {} by a formula", listed(&covariates)),
        }
    }

    /// Where its equation comes from.
    pub fn source(&self) -> &str {
        if self.definition.source.is_empty() { "a formula of the user" } else { &self.definition.source }
    }

    /// The meaning of a parameter, as a sentence.
    pub fn meaning_of(&self, parameter: &str) -> String {
        let given = self.definition.parameters.get(parameter).map(|p| p.table().meaning).unwrap_or_default();
        match given.is_empty() {
            true => format!("Parameter {parameter} of the formula {}.", self.definition.formula.texts().join("; ")),
            false => given,
        }
    }

    /// Nominal values of its parameters.
    pub fn nominal(&self) -> Vec<f64> {
        self.definition.parameters.values().map(|parameter| parameter.table().nominal).collect()
    }

    /// The meanings of names, with the constants' values.
    pub fn meaning<'a>(&'a self, options: &Options) -> impl Fn(&str) -> Meaning + use<'a> {
        let given = options.clone();
        let parameters: Vec<&String> = self.definition.parameters.keys().collect();
        move |name: &str| {
            if let Some(index) = parameters.iter().position(|p| *p == name) {
                return Meaning::Parameter(index as u16);
            }
            if let Some(constant) = self.definition.constants.get(name) {
                return Meaning::Constant(given.get(name).copied().unwrap_or(constant.value()));
            }
            match FormulaCovariate::of(name) {
                Some(covariate) => Meaning::Covariate(covariate),
                None => Meaning::Constant(std::f64::consts::PI),
            }
        }
    }
}

/// Words as a list in a sentence.
fn listed(words: &[&str]) -> String {
    match words {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => words.concat(),
    }
}
