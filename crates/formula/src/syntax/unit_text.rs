//! The parser of units.

use pest::Parser;
use pest::iterators::Pair;

use super::parse::{Grammar, Rule, SyntaxError, refuse};

/// Longest text of a unit, bytes.
const LONGEST: usize = 100;

/// A symbol of a unit with its exponent and its place in the text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Factor {
    pub symbol: String,
    pub exponent: i32,
    pub span: std::ops::Range<usize>,
}

/// The symbols of a unit such as `1/(mm s)`, `mm/°C` or `mm²`; none for `1`.
pub(crate) fn parse_unit(text: &str) -> Result<Vec<Factor>, SyntaxError> {
    if text.len() > LONGEST {
        return Err(SyntaxError { problem: format!("is longer than {LONGEST} bytes"), span: 0..text.len() });
    }
    let mut pairs = Grammar::parse(Rule::unit, text).map_err(refuse)?;
    let mut factors = Vec::new();
    if let Some(product) = pairs.next().and_then(|unit| unit.into_inner().next()) {
        of_product(product, 1, &mut factors)?;
    }
    Ok(factors)
}

fn of_product(product: Pair<'_, Rule>, power: i32, factors: &mut Vec<Factor>) -> Result<(), SyntaxError> {
    let mut sign = 1;
    for part in product.into_inner() {
        match part.as_rule() {
            Rule::times => sign = 1,
            Rule::over => sign = -1,
            _ => {
                of_factor(part, power * sign, factors)?;
                sign = 1;
            }
        }
    }
    Ok(())
}

fn of_factor(factor: Pair<'_, Rule>, power: i32, factors: &mut Vec<Factor>) -> Result<(), SyntaxError> {
    let span = factor.as_span().start()..factor.as_span().end();
    let mut parts = factor.into_inner();
    let Some(base) = parts.next() else { return Ok(()) };
    let exponent = match parts.next() {
        None => 1,
        Some(text) => exponent_of(text.as_str()).ok_or_else(|| SyntaxError {
            problem: "expected an exponent between −9 and 9".to_owned(),
            span: span.clone(),
        })?,
    };
    let power = power * exponent;
    match base.as_rule() {
        Rule::one => {}
        Rule::symbol => {
            let span = base.as_span().start()..base.as_span().end();
            factors.push(Factor { symbol: base.as_str().to_owned(), exponent: power, span });
        }
        _ => of_product(base, power, factors)?,
    }
    Ok(())
}

fn exponent_of(text: &str) -> Option<i32> {
    let plain: String = text
        .chars()
        .filter(|c| !matches!(c, '^' | ' '))
        .map(|c| match c {
            '⁻' => '-',
            '¹' => '1',
            '²' => '2',
            '³' => '3',
            '⁴' => '4',
            other => other,
        })
        .collect();
    plain.parse().ok().filter(|exponent: &i32| exponent.abs() <= 9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_products_of_symbols() {
        let read = |text: &str| -> Vec<(String, i32)> {
            parse_unit(text).unwrap().into_iter().map(|f| (f.symbol, f.exponent)).collect()
        };
        let pairs = |list: &[(&str, i32)]| list.iter().map(|(s, e)| ((*s).to_owned(), *e)).collect::<Vec<_>>();
        assert_eq!(read("1"), pairs(&[]));
        assert_eq!(read("1/mm"), pairs(&[("mm", -1)]));
        assert_eq!(read("mm² / °C"), pairs(&[("mm", 2), ("°C", -1)]));
        assert_eq!(read("1/(mm * s^2)"), pairs(&[("mm", -1), ("s", -2)]));
        assert_eq!(read("px·mm⁻¹"), pairs(&[("px", 1), ("mm", -1)]));
        assert!(parse_unit("mm^99").is_err());
        assert_eq!(read("mm/s px"), pairs(&[("mm", 1), ("s", -1), ("px", 1)]));
        assert!(parse_unit("mm//s").is_err());
        assert!(parse_unit("").is_err());
    }
}
