//! The checks of a definition: names, syntax and units.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use depthcal_model::{AddsTo, FormulaDefinition};

use crate::content::{Content, target_name, targets};
use crate::covariate::FormulaCovariate;
use crate::error::FormulaError;
use crate::syntax::{Expression, Function, Position, SyntaxError, parse, underlined};
use crate::units::{Clash, Inference, Unit, check};

/// Most parameters of a formula.
pub const MOST_PARAMETERS: usize = 96;
/// The name of formulas that is a number.
const PI: &str = "pi";

/// Whether a name consists of letters, digits and underscores and begins with a letter; `lower` allows small letters only.
fn is_name(name: &str, lower: bool) -> bool {
    let first = name.chars().next().is_some_and(|c| c.is_alphabetic() && (!lower || c.is_ascii_lowercase()));
    let is_inner = |c: char| match lower {
        true => c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_',
        false => c.is_alphanumeric() || c == '_',
    };
    first && name.len() <= 60 && name.chars().all(is_inner)
}

/// The content of a definition without typical deviations of its parameters.
pub(crate) fn read(definition: FormulaDefinition) -> Result<Content, FormulaError> {
    let reader = Reader { definition: &definition };
    let adds_to = reader.head()?;
    reader.names()?;
    let expressions = reader.expressions(adds_to)?;
    let covariates = reader.covariates(&expressions)?;
    let units_of_constants = reader.units(&expressions, adds_to)?;
    reader.searched(&covariates)?;
    Ok(Content { adds_to, expressions, covariates, units_of_constants, scales: Vec::new(), definition })
}

/// The checks of a definition.
struct Reader<'a> {
    definition: &'a FormulaDefinition,
}

impl Reader<'_> {
    fn field(&self, field: impl Into<String>, problem: impl Into<String>) -> FormulaError {
        FormulaError::Field { effect: self.definition.name.clone(), field: field.into(), problem: problem.into() }
    }

    fn text(&self, field: &str, text: &str, problem: String, span: Range<usize>) -> FormulaError {
        let Position { line, column } = Position::of(text, span.start);
        FormulaError::Text {
            effect: self.definition.name.clone(),
            field: field.to_owned(),
            line,
            column,
            problem,
            excerpt: underlined(text, span.start, span.end),
        }
    }

    /// Name, hook and target.
    fn head(&self) -> Result<AddsTo, FormulaError> {
        let definition = self.definition;
        if !is_name(&definition.name, true) {
            let problem =
                format!("'{}' has to consist of small letters, digits and _ and begin with a letter", definition.name);
            return Err(self.field("name", problem));
        }
        let known = targets(definition.hook);
        let Some((usual, _)) = known.first() else {
            return Err(FormulaError::Hook { effect: definition.name.clone(), hook: definition.hook });
        };
        let adds_to = definition.adds_to.unwrap_or(*usual);
        if known.iter().all(|(target, _)| *target != adds_to) {
            let names: Vec<&str> = known.iter().map(|(target, _)| target_name(*target)).collect();
            let problem = format!(
                "'{}' is nothing that a formula of hook '{}' adds to: write {}",
                target_name(adds_to),
                definition.hook.name(),
                names.join(", ")
            );
            return Err(self.field("adds_to", problem));
        }
        Ok(adds_to)
    }

    /// Names of parameters and constants.
    fn names(&self) -> Result<(), FormulaError> {
        let FormulaDefinition { parameters, constants, .. } = self.definition;
        if parameters.is_empty() {
            return Err(self.field("parameters", "has none: write parameters = { a = \"mm\" } with the unit of each"));
        }
        if parameters.len() > MOST_PARAMETERS {
            return Err(
                self.field("parameters", format!("has {}, at most {MOST_PARAMETERS} are allowed", parameters.len()))
            );
        }
        let all = parameters.keys().map(|n| ("parameters", n)).chain(constants.keys().map(|n| ("constants", n)));
        for (section, name) in all {
            let problem = if !is_name(name, false) {
                "has to consist of letters, digits and _ and begin with a letter"
            } else if FormulaCovariate::reserved(name).is_some() {
                "is the name of a covariate: choose another"
            } else if Function::of(name).is_some() || name == PI {
                "is the name of a function or of a number: choose another"
            } else if section == "constants" && parameters.contains_key(name) {
                "is a parameter too: choose another name"
            } else {
                continue;
            };
            return Err(self.field(format!("{section}.{name}"), problem));
        }
        for (name, parameter) in parameters {
            if !parameter.table().nominal.is_finite() {
                return Err(self.field(format!("parameters.{name}.nominal"), "has to be a finite number"));
            }
        }
        self.smooth()?;
        match constants.iter().find(|(_, constant)| !constant.value().is_finite()) {
            Some((name, _)) => Err(self.field(format!("constants.{name}"), "has to be a finite number")),
            None => Ok(()),
        }
    }

    fn expressions(&self, adds_to: AddsTo) -> Result<Vec<Expression>, FormulaError> {
        let texts = self.definition.formula.texts();
        let expected = if matches!(adds_to, AddsTo::Xy | AddsTo::Uv) { 2 } else { 1 };
        if texts.len() != expected {
            let target = target_name(adds_to);
            let problem = match expected {
                2 => format!("adds_to = \"{target}\" takes two formulas: formula = [\"…\", \"…\"]"),
                _ => format!("adds_to = \"{target}\" takes one formula"),
            };
            return Err(self.field("formula", problem));
        }
        let refuse = |text: &str, e: SyntaxError| self.text("formula", text, e.problem, e.span);
        texts.iter().map(|text| parse(text).map_err(|e| refuse(text, e))).collect()
    }

    /// The covariates, after a check that every name is known and every parameter and constant is used.
    fn covariates(&self, expressions: &[Expression]) -> Result<Vec<FormulaCovariate>, FormulaError> {
        let FormulaDefinition { parameters, constants, formula, hook, .. } = self.definition;
        let here = FormulaCovariate::at(*hook);
        let mut used: Vec<FormulaCovariate> = Vec::new();
        let mut names: Vec<&str> = Vec::new();
        for (expression, text) in expressions.iter().zip(formula.texts()) {
            for (name, span) in expression.names() {
                names.push(name);
                if parameters.contains_key(name) || constants.contains_key(name) || name == PI {
                    continue;
                }
                let known = here.iter().map(|c| c.name()).collect::<Vec<_>>().join(", ");
                let problem = match FormulaCovariate::of(name) {
                    Some(covariate) if covariate.is_known_at(*hook) => {
                        used.push(covariate);
                        continue;
                    }
                    Some(_) => {
                        format!("'{name}' is not known at hook '{}'; covariates there are {known}", hook.name())
                    }
                    None => format!(
                        "'{name}' is no covariate, parameter or constant: declare it in parameters or constants, or use \
                         one of {known}, or a column of frames.csv, whose name ends in its unit, such as exposure_ms"
                    ),
                };
                return Err(self.text("formula", text, problem, span));
            }
        }
        let sections = parameters.keys().map(|n| ("parameters", n)).chain(constants.keys().map(|n| ("constants", n)));
        for (section, name) in sections {
            if !names.contains(&name.as_str()) {
                return Err(self.field(format!("{section}.{name}"), "is not used in the formula: remove it"));
            }
        }
        used.sort_unstable();
        used.dedup();
        Ok(used)
    }

    /// Units of the constants, after a check that all units agree.
    fn units(&self, expressions: &[Expression], adds_to: AddsTo) -> Result<BTreeMap<String, String>, FormulaError> {
        let FormulaDefinition { parameters, constants, formula, hook, .. } = self.definition;
        let mut inference = Inference::default();
        let mut units: BTreeMap<&str, Unit> = BTreeMap::new();
        let declared = |field: String, text: &str| {
            Unit::parse(text).map_err(|e: SyntaxError| self.text(&field, text, e.problem, e.span))
        };
        for (name, parameter) in parameters {
            units.insert(name, declared(format!("unit of parameters.{name}"), &parameter.table().unit)?);
        }
        for (name, constant) in constants {
            let unit = match constant.unit() {
                Some(text) => declared(format!("unit of constants.{name}"), text)?,
                None => inference.unknown(),
            };
            units.insert(name, unit);
        }
        let of_name = |name: &str| match (units.get(name), FormulaCovariate::of(name)) {
            (Some(unit), _) => unit.clone(),
            (None, Some(covariate)) => Unit::parse(covariate.unit()).unwrap_or_default(),
            (None, None) => Unit::one(),
        };
        let target = targets(*hook).iter().find(|(target, _)| *target == adds_to).map_or("1", |(_, unit)| *unit);
        let expected = Unit::parse(target).unwrap_or_default();
        for (expression, text) in expressions.iter().zip(formula.texts()) {
            let refuse = |Clash { problem, span }| self.text("formula", text, problem, span);
            let unit = check(expression, text, &mut inference, &of_name).map_err(refuse)?;
            if !inference.equate(&unit, &expected) {
                let unit = inference.resolve(&unit);
                let in_words =
                    |unit: &Unit| if unit.is_one() { "a plain number".to_owned() } else { format!("in {unit}") };
                let problem = format!(
                    "the formula is {}, but {} is {}: change the unit of a parameter or adds_to",
                    in_words(&unit),
                    target_name(adds_to),
                    in_words(&expected)
                );
                return Err(self.text("formula", text, problem, expression.span.clone()));
            }
        }
        let resolved = |name: &String| {
            let unit = inference.resolve(&of_name(name)).to_string();
            (name.clone(), if unit.contains('?') { "1".to_owned() } else { unit })
        };
        Ok(constants.keys().map(resolved).collect())
    }

    /// Parameters of smooth functions are declared once, with deviations above zero.
    fn smooth(&self) -> Result<(), FormulaError> {
        let FormulaDefinition { parameters, smooth, .. } = self.definition;
        let mut known = BTreeSet::new();
        for (number, part) in smooth.iter().enumerate() {
            let field = |name: &str| format!("smooth[{number}].{name}");
            for name in &part.parameters {
                if !parameters.contains_key(name) {
                    return Err(self.field(field("parameters"), format!("'{name}' is no parameter")));
                }
                if !known.insert(name) {
                    return Err(self.field(field("parameters"), format!("has '{name}' twice")));
                }
            }
            if part.per_row.is_some_and(|per_row| per_row == 0 || part.parameters.len() % per_row != 0) {
                let problem = format!("does not divide the number of its parameters, {}", part.parameters.len());
                return Err(self.field(field("per_row"), problem));
            }
            for (name, value) in [("roughness", part.roughness), ("deviation", part.deviation)] {
                if !(value > 0.0 && value.is_finite()) {
                    return Err(self.field(field(name), "has to be above 0".to_owned()));
                }
            }
        }
        Ok(())
    }

    /// Searched constants need a covariate over which they can be searched.
    fn searched(&self, covariates: &[FormulaCovariate]) -> Result<(), FormulaError> {
        let constants = &self.definition.constants;
        let Some((name, _)) = constants.iter().find(|(_, constant)| constant.search().is_some()) else { return Ok(()) };
        match covariates.iter().find_map(|covariate| covariate.searched()) {
            Some(_) => Ok(()),
            None => Err(self.field(
                format!("constants.{name}.search"),
                "is possible only in formulas of depth, inverse depth, incidence, amplitude, time, temperature or a column of \
                 frames.csv: remove it",
            )),
        }
    }
}
