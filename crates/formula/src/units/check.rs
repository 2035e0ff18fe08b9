//! The unit of an expression; where its parts do not fit together, which parts.

use std::ops::Range;

use super::inference::Inference;
use super::unit::Unit;
use crate::syntax::{Expression, Function, Node, Operator, SPLINE_RANGE};

/// Parts of a formula whose units do not fit, with the bytes at fault.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Clash {
    pub problem: String,
    pub span: Range<usize>,
}

/// The unit of an expression of `text`, given those of names.
pub(crate) fn check(
    expression: &Expression,
    text: &str,
    units: &mut Inference,
    of_name: &impl Fn(&str) -> Unit,
) -> Result<Unit, Clash> {
    let unit_of = |part: &Expression, units: &mut Inference| check(part, text, units, of_name);
    let written = |part: &Expression| &text[part.span.clone()];
    let plain = |part: &Expression, what: &str, units: &mut Inference| -> Result<(), Clash> {
        let unit = unit_of(part, units)?;
        if units.equate(&unit, &Unit::one()) {
            return Ok(());
        }
        let problem = format!(
            "{what} has to be a plain number, but '{}' is in {}: divide it by a constant of that unit",
            written(part),
            units.resolve(&unit)
        );
        Err(Clash { problem, span: part.span.clone() })
    };
    match &expression.node {
        Node::Number(_) => Ok(Unit::one()),
        Node::Name(name) => Ok(of_name(name)),
        Node::Negative(part) => unit_of(part, units),
        Node::Binary(Operator::Multiply, a, b) => Ok(unit_of(a, units)?.times(&unit_of(b, units)?)),
        Node::Binary(Operator::Divide, a, b) => Ok(unit_of(a, units)?.over(&unit_of(b, units)?)),
        Node::Binary(Operator::Power, base, exponent) => {
            if let Some(power) = number(exponent) {
                return Ok(unit_of(base, units)?.power(power));
            }
            plain(exponent, "an exponent", units)?;
            plain(base, "what has an exponent that varies", units)?;
            Ok(Unit::one())
        }
        Node::Binary(Operator::Add | Operator::Subtract, a, b) => same(a, b, expression, text, units, of_name),
        Node::Call(Function::Min | Function::Max, parts) => {
            same(&parts[0], &parts[1], expression, text, units, of_name)
        }
        Node::Call(Function::Spline, parts) => {
            let (range, coefficients) = parts.split_at(SPLINE_RANGE);
            range
                .windows(2)
                .try_for_each(|pair| same(&pair[0], &pair[1], expression, text, units, of_name).map(drop))?;
            // Nothing is nothing in any unit.
            let mut given = coefficients.iter().filter(|part| number(part) != Some(0.0));
            let Some(first) = given.next() else { return Ok(Unit::one()) };
            given.try_for_each(|other| same(first, other, expression, text, units, of_name).map(drop))?;
            unit_of(first, units)
        }
        Node::Call(Function::Sqrt, parts) => Ok(unit_of(&parts[0], units)?.power(0.5)),
        Node::Call(Function::Abs | Function::Hinge, parts) => unit_of(&parts[0], units),
        Node::Call(Function::Step, parts) => unit_of(&parts[0], units).map(|_| Unit::one()),
        Node::Call(function, parts) => {
            let what = format!("the argument of {}", function.name());
            plain(&parts[0], &what, units)?;
            Ok(Unit::one())
        }
    }
}

/// The unit of two parts that have to have the same.
fn same(
    a: &Expression,
    b: &Expression,
    whole: &Expression,
    text: &str,
    units: &mut Inference,
    of_name: &impl Fn(&str) -> Unit,
) -> Result<Unit, Clash> {
    let of_a = check(a, text, units, of_name)?;
    let of_b = check(b, text, units, of_name)?;
    if units.equate(&of_a, &of_b) {
        return Ok(of_a);
    }
    let in_words = |part: &Expression, unit: &Unit| {
        let unit = units.resolve(unit);
        let written = &text[part.span.clone()];
        if unit.is_one() { format!("'{written}' is a plain number") } else { format!("'{written}' is in {unit}") }
    };
    Err(Clash {
        problem: format!("the units clash: {}, but {}", in_words(a, &of_a), in_words(b, &of_b)),
        span: whole.span.clone(),
    })
}

/// The value of an exponent that is a number.
fn number(expression: &Expression) -> Option<f64> {
    match &expression.node {
        Node::Number(value) => Some(*value),
        Node::Negative(part) => number(part).map(|value| -value),
        Node::Binary(Operator::Divide, a, b) => Some(number(a)? / number(b)?).filter(|value| value.is_finite()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::syntax::parse;

    fn unit_of(text: &str) -> Result<String, Clash> {
        let mut units = Inference::default();
        let k = units.unknown();
        let of_name = |name: &str| match name {
            "z" | "a" => Unit::parse("mm").unwrap(),
            "rho" => Unit::parse("1/mm").unwrap(),
            "k" => k.clone(),
            _ => Unit::one(),
        };
        let unit = check(&parse(text).unwrap(), text, &mut units, &of_name)?;
        Ok(units.resolve(&unit).to_string())
    }

    #[test]
    fn units_of_formulas() {
        for (text, expected) in [
            ("a * x * log(rho / k)", "mm"),
            ("a * z^2 * rho", "mm²"),
            ("sqrt(z^2 + a*z)", "mm"),
            ("a * (z*rho)^x", "mm"),
            ("z - k", "mm"),
            ("a * exp(-z/k)", "mm"),
            ("z^(1/2)", "mm^0.5"),
            ("a * step(z - k) + hinge(z - k)", "mm"),
            ("spline(x, 0, 1, 0, a, z, a)", "mm"),
            ("z * spline(z, k, 2*k, 1, x, 2, 0)", "mm"),
        ] {
            assert_eq!(unit_of(text).as_deref(), Ok(expected), "{text}");
        }
    }

    #[test]
    fn a_clash_names_the_parts_and_their_units() {
        let clash = unit_of("a * (z - 1000)").unwrap_err();
        assert_eq!(clash.problem, "the units clash: 'z' is in mm, but '1000' is a plain number");
        assert_eq!(clash.span, 5..13);
        let clash = unit_of("a*sin(z)").unwrap_err();
        assert!(clash.problem.contains("the argument of sin has to be a plain number, but 'z' is in mm"), "{clash:?}");
        let clash = unit_of("log(rho/k) + k*z*z").unwrap_err();
        assert!(clash.problem.contains("'k*z*z' is in mm"), "{clash:?}");
        let clash = unit_of("spline(z, 0, k, a, a, a, a)").unwrap_err();
        assert!(clash.problem.contains("'z' is in mm, but '0' is a plain number"), "{clash:?}");
        assert!(unit_of("spline(x, 0, 1, a, a, x, a)").unwrap_err().problem.contains("'a' is in mm"));
        assert!(unit_of("z^x").unwrap_err().problem.contains("an exponent that varies"));
    }
}
