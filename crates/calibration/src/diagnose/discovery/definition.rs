//! A term as a formula: its text, with units and constants, in the form of files.

use std::collections::BTreeMap;

use depthcal_formula::{FormulaCovariate as C, FormulaEffect, FormulaError};
use depthcal_model::hook::HookKind;
use depthcal_model::{
    AddsTo, ConstantTable, FormulaConstant, FormulaDefinition, FormulaParameter, FormulaText, On, ParameterTable,
};

use super::library::{Function, Kind, three_digits};
use super::term::{Product, Term};
use super::units::Exponents;

/// Names of parameters in the order of the columns.
const PARAMETERS: [&str; 3] = ["a", "b", "c"];

/// The unit of a covariate.
pub(super) fn unit_of(covariate: C) -> Exponents {
    match covariate {
        C::Rho => Exponents::of("mm", -1),
        other => Exponents::of(other.unit(), 1),
    }
}

/// The unit of a function's value.
fn unit_of_value(function: &Function) -> Exponents {
    let power = match function.kind {
        Kind::Power(n) | Kind::Centred(n) => n,
        Kind::HingeUp | Kind::HingeDown | Kind::Distance => 1,
        _ => 0,
    };
    unit_of(function.covariate).power(power)
}

/// The constants of a formula under names that are free.
#[derive(Default)]
struct Constants {
    known: BTreeMap<String, FormulaConstant>,
}

impl Constants {
    /// The name of a constant, which is `wanted` where that is free.
    fn name(&mut self, wanted: &str, function: &Function) -> String {
        let value: f64 = format!("{:.3e}", function.constant).parse().unwrap_or(function.constant);
        let unit = Some(unit_of(function.covariate).to_string());
        let constant = FormulaConstant::Table(ConstantTable { value, unit, search: None });
        let numbered = (2..).map(|n| format!("{wanted}{n}"));
        let names = std::iter::once(wanted.to_owned()).chain(numbered);
        let free = |name: &String| self.known.get(name).is_none_or(|other| *other == constant);
        let name = names.take(10).find(free).unwrap_or_else(|| wanted.to_owned());
        self.known.insert(name.clone(), constant);
        name
    }
}

/// A function in a formula; without its parameters for those of one column.
fn text_of(function: &Function, constants: &mut Constants) -> String {
    let v = function.covariate.name();
    let mut k = || {
        let wanted = match (function.kind, function.covariate) {
            (Kind::Wave, _) => "period",
            (_, C::Temperature) => "t0",
            (_, C::Amplitude) => "a0",
            (_, C::Z) => "z0",
            (_, C::Time) => "tau",
            _ => "k",
        };
        constants.name(wanted, function)
    };
    match function.kind {
        Kind::Power(1) => v.to_owned(),
        Kind::Power(-1) => format!("1 / {v}"),
        Kind::Power(n) => format!("{v}^{n}"),
        Kind::Centred(1) => format!("({v} - {})", k()),
        Kind::Centred(n) => format!("({v} - {})^{n}", k()),
        Kind::Log => format!("log({v} / {})", k()),
        Kind::InverseRoot => format!("sqrt({} / {v})", k()),
        Kind::Decay => format!("exp(-{v} / {})", k()),
        Kind::Settling => format!("(1 - exp(-{v} / {}))", k()),
        Kind::Wave => format!("(2 * pi * {v} / {})", k()),
        Kind::Ratio => format!("{v} / ({v} + {})", k()),
        Kind::Distance => format!("abs({v} - {})", k()),
        Kind::Step => format!("step({v} - {})", k()),
        Kind::HingeUp => format!("hinge({v} - {})", k()),
        Kind::HingeDown => format!("hinge({} - {v})", k()),
    }
}

/// The text of a product with the names of its parameters.
fn product_text(product: &Product, parameters: &[&str], constants: &mut Constants) -> String {
    if *product == Product::OFFSET {
        return parameters[0].to_owned();
    }
    let factor = product.factor.map(|factor| text_of(&factor, constants));
    let function = text_of(&product.function, constants);
    if product.function.kind == Kind::Wave {
        let wave = format!("{} * sin{function} + {} * cos{function}", parameters[0], parameters[1]);
        return factor.map_or(wave.clone(), |factor| format!("{factor} * ({wave})"));
    }
    let a = parameters[0];
    match (factor, function.strip_prefix("1 / ")) {
        (None, None) => format!("{a} * {function}"),
        (None, Some(below)) => format!("{a} / {below}"),
        (Some(factor), None) => format!("{a} * {factor} * {function}"),
        (Some(factor), Some(below)) => format!("{a} * {factor} / {below}"),
    }
}

/// The formula of a term under a name. `sizes` are typical deviations of its parameters from zero, where they are known: the
/// captured range may lie beyond the usual one.
pub(super) fn effect_of(term: &Term, name: &str, sizes: &[f64]) -> Result<FormulaEffect, FormulaError> {
    let mut constants = Constants::default();
    let mut parameters = BTreeMap::new();
    let (adds_to, target) = match term.on {
        On::Depth => (AddsTo::Depth, Exponents::of("mm", 1)),
        On::InverseDepth => (AddsTo::InverseDepth, Exponents::of("mm", -1)),
        On::Factor => (AddsTo::Factor, Exponents::default()),
    };
    let mut texts = Vec::new();
    let mut next = 0;
    for product in &term.products {
        let names = &PARAMETERS[next..next + product.columns()];
        next += product.columns();
        let functions = product.factor.iter().chain([&product.function]);
        let unit = functions.fold(target.clone(), |unit, function| unit.over(&unit_of_value(function)));
        for name in names {
            let size = sizes.get(parameters.len()).map(|size| three_digits(size.abs())).filter(|size| *size > 0.0);
            let unit = unit.to_string();
            let parameter = match size {
                None => FormulaParameter::Unit(unit),
                Some(_) => FormulaParameter::Table(ParameterTable {
                    unit,
                    nominal: 0.0,
                    scale: size,
                    value: None,
                    meaning: String::new(),
                }),
            };
            parameters.insert((*name).to_owned(), parameter);
        }
        texts.push(product_text(product, names, &mut constants));
    }
    FormulaEffect::new(FormulaDefinition {
        smooth: Vec::new(),
        name: name.to_owned(),
        hook: HookKind::Depth,
        adds_to: Some(adds_to),
        of: term.of,
        formula: FormulaText::One(texts.join(" + ")),
        parameters,
        constants: constants.known,
        summary: String::new(),
        source: "found in the residuals by depthcal diagnose".to_owned(),
    })
}

/// A name for the formula of a term: `found_y_rho`.
pub(super) fn name_of(term: &Term) -> String {
    let short = |covariate: C| match covariate {
        C::Time => "time",
        C::Temperature => "temperature",
        other => other.name(),
    };
    let names: Vec<&str> = term.covariates().into_iter().map(short).collect();
    format!("found_{}", names.join("_").to_lowercase())
}

#[cfg(test)]
mod tests {
    use depthcal_model::Of;

    use super::super::library::{Density, Span, factors, functions};
    use super::*;

    /// Every product of the library is a formula: its units agree, and it is zero at nominal parameters.
    #[test]
    fn all_products_of_the_library_are_formulas() {
        let span = |c: C| {
            let [low, high] = c.typical_range();
            Span { low, middle: 0.5 * (low + high), high }
        };
        let covariates = || C::ALL.into_iter().filter(|c| !matches!(c, C::BoardX | C::BoardY | C::Surroundings));
        let some = |c: C| {
            let mut kinds = Vec::new();
            let mut list = functions(c, span(c), Density::Coarse);
            list.retain(|f| !kinds.contains(&f.kind) && (kinds.push(f.kind), true).1);
            list
        };
        let mut count = 0;
        for of in Of::ALL {
            for on in On::ALL {
                for c in covariates() {
                    for function in some(c) {
                        let factors = covariates().filter(|other| *other != c).flat_map(|o| factors(o, span(o)));
                        for factor in std::iter::once(None).chain(factors.map(Some)) {
                            let term = Term::new(of, on, Product { factor, function });
                            let effect = effect_of(&term, &name_of(&term), &[]);
                            let effect = effect.unwrap_or_else(|e| panic!("{term:?}: {e}"));
                            assert_eq!(effect.scales().len(), term.columns());
                            count += 1;
                        }
                    }
                }
            }
        }
        assert!(count > 1000, "{count}");
    }
}
