//! Splines as a formula, with their coefficients as its parameters.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_formula::{FormulaCovariate as C, FormulaEffect};
use depthcal_model::hook::HookKind;
use depthcal_model::{
    AddsTo, ConstantTable, FormulaConstant, FormulaDefinition, FormulaParameter, FormulaText, On, ParameterTable,
    SmoothParameters,
};
use depthcal_solver::additive::Precision;

use super::super::definition::unit_of;
use super::super::units::Exponents;
use super::dictionary::{Function, Smooth};

/// A function of the dictionary with what its formula needs.
#[derive(Debug)]
pub(super) struct Part<'a> {
    pub function: &'a Function,
    pub precision: Precision,
    /// Root mean square over the samples of the change of inverse depth where the function is 1.
    pub rms: f64,
}

/// Typical change of inverse depth, 1/mm: a millimetre at a metre.
const TYPICAL: f64 = 1e-6;

/// The sum of some groups as a formula, `found_r_z` or the like.
pub(super) fn formula(covariates: &BTreeSet<C>, parts: &[Part<'_>], taken: &[String]) -> Result<FormulaEffect, String> {
    // Groups of one function may have different forms: they are brought to the first one's by powers of depth.
    let (place, on) = (parts[0].function.of, parts[0].function.on);
    let (adds_to, target) = match on {
        On::Depth => (AddsTo::Depth, Exponents::of("mm", 1)),
        On::InverseDepth => (AddsTo::InverseDepth, Exponents::of("mm", -1)),
        On::Factor => (AddsTo::Factor, Exponents::default()),
    };
    let mut definition = FormulaDefinition {
        name: free_name(covariates, taken),
        hook: HookKind::Depth,
        adds_to: Some(adds_to),
        of: place,
        formula: FormulaText::One(String::new()),
        parameters: BTreeMap::new(),
        smooth: Vec::new(),
        constants: BTreeMap::new(),
        summary: "a smooth function that describes what is left, without a cause".to_owned(),
        source: "found in the residuals by depthcal diagnose".to_owned(),
    };
    let mut texts = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        let mut unit = target.clone();
        let mut factors = String::new();
        if let Some((covariate, mean)) = part.function.factor {
            let name = format!("m{}", number + 1);
            definition.constants.insert(name.clone(), constant(mean, covariate));
            factors += &format!("({} - {name}) * ", covariate.name());
            unit = unit.over(&unit_of(covariate));
        }
        let (power, exponent) = power_between(part.function.on, on);
        factors += power;
        let unit = unit.over(&Exponents::of("mm", exponent));
        let first = definition.parameters.len() + 1;
        // Digits keep the order of names that of numbers.
        let names: Vec<String> = (first..first + part.function.count()).map(|c| format!("c{c:02}")).collect();
        for name in &names {
            let table = ParameterTable {
                unit: unit.to_string(),
                nominal: 0.0,
                scale: Some(rounded(TYPICAL / part.rms, 1)),
                value: None,
                meaning: "Coefficient of the spline.".to_owned(),
            };
            definition.parameters.insert(name.clone(), FormulaParameter::Table(table));
        }
        let per_row = if let [along, _] = &part.function.splines[..] { Some(along.axis.count) } else { None };
        let mut spline = |smooth: Smooth, label: &str, coefficients: &[String]| {
            format!("spline({}, {})", range(&mut definition, smooth, label), coefficients.join(", "))
        };
        let label = (number + 1).to_string();
        let shape = match &part.function.splines[..] {
            [] => names.join(", "),
            [smooth] => spline(*smooth, &label, &names),
            // The coefficients of a spline of one covariate are splines of the other.
            [along, across, ..] => {
                let rows: Vec<String> = names.chunks(along.axis.count).map(|row| spline(*along, &label, row)).collect();
                spline(*across, &format!("{label}b"), &rows)
            }
        };
        texts.push(format!("{factors}{shape}"));
        let deviation = |precision: f64| rounded(1.0 / precision.sqrt(), 3);
        let Precision { roughness, ridge } = part.precision;
        let (roughness, deviation) = (deviation(roughness), deviation(ridge));
        definition.smooth.push(SmoothParameters { parameters: names, per_row, roughness, deviation });
    }
    definition.formula = FormulaText::One(texts.join(" + "));
    FormulaEffect::new(definition).map_err(|error| error.to_string())
}

/// The first arguments of a spline: its covariate with both ends of the range, which become constants.
fn range(definition: &mut FormulaDefinition, smooth: Smooth, label: &str) -> String {
    let Smooth { covariate, axis, .. } = smooth;
    // Amplitudes are spread over decades: the axis has their logarithm.
    let is_log = covariate == C::Amplitude;
    let ends = if is_log { [axis.low.exp(), axis.high.exp()] } else { [axis.low, axis.high] };
    let [low, high] = ["low", "high"].map(|word| format!("{word}{label}"));
    for (name, end) in [&low, &high].into_iter().zip(ends) {
        definition.constants.insert(name.clone(), constant(end, covariate));
    }
    let name = covariate.name();
    if is_log { format!("log({name} / {low}), 0, log({high} / {low})") } else { format!("{name}, {low}, {high}") }
}

fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

fn constant(value: f64, covariate: C) -> FormulaConstant {
    FormulaConstant::Table(ConstantTable {
        value: rounded(value, 6),
        unit: Some(unit_of(covariate).to_string()),
        search: None,
    })
}

/// A power of depth that takes the values of one form to another, as text that ends in a product sign, and its exponent of mm: a
/// change of depth is ρ² times one of inverse depth with the other sign, and ρ times a factor.
fn power_between(own: On, other: On) -> (&'static str, i32) {
    // Exponent of z in δz of either form.
    let exponent = |on: On| match on {
        On::Depth => 0,
        On::Factor => 1,
        On::InverseDepth => 2,
    };
    match exponent(own) - exponent(other) {
        2 => ("z^2 * ", 2),
        1 => ("z * ", 1),
        -1 => ("rho * ", -1),
        -2 => ("rho^2 * ", -2),
        _ => ("", 0),
    }
}

/// `found_r_z` or the like, with a number where it is taken.
fn free_name(covariates: &BTreeSet<C>, taken: &[String]) -> String {
    let short = |covariate: &C| match covariate {
        C::Time => "time",
        C::Temperature => "temperature",
        other => other.name(),
    };
    let name = format!("found_{}", covariates.iter().map(short).collect::<Vec<_>>().join("_").to_lowercase());
    let numbered = (2..).map(|n| format!("{name}_{n}"));
    std::iter::once(name.clone()).chain(numbered).take(100).find(|name| !taken.contains(name)).unwrap_or(name)
}
