//! The parser of formulas.

use std::ops::Range;
use std::sync::LazyLock;

use pest::Parser;
use pest::error::{ErrorVariant, InputLocation};
use pest::iterators::Pair;
use pest::pratt_parser::{Assoc, Op, PrattParser};

use super::expression::{Expression, Function, Node, Operator};

/// The grammar of formulas and units.
#[derive(pest_derive::Parser)]
#[grammar = "syntax/grammar.pest"]
pub(super) struct Grammar;

/// Why a text is no formula or no unit, with the bytes at fault.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SyntaxError {
    pub problem: String,
    pub span: Range<usize>,
}

/// Longest text of a formula, bytes: deeper nesting than this allows could exhaust the stack.
const LONGEST: usize = 1000;
/// Most nested brackets.
const DEEPEST: usize = 100;

/// Powers bind first and from the right, then a sign, then products, then sums: −x² is −(x²) and 2⁻ˣ is allowed.
static PRECEDENCE: LazyLock<PrattParser<Rule>> = LazyLock::new(|| {
    PrattParser::new()
        .op(Op::infix(Rule::add, Assoc::Left) | Op::infix(Rule::subtract, Assoc::Left))
        .op(Op::infix(Rule::multiply, Assoc::Left) | Op::infix(Rule::divide, Assoc::Left))
        .op(Op::prefix(Rule::negative) | Op::prefix(Rule::positive))
        .op(Op::infix(Rule::power, Assoc::Right))
});

/// Parses a formula.
pub(crate) fn parse(text: &str) -> Result<Expression, SyntaxError> {
    let whole = |problem: String| SyntaxError { problem, span: 0..text.len() };
    if text.len() > LONGEST {
        return Err(whole(format!("is longer than {LONGEST} bytes")));
    }
    let depth = text.chars().scan(0_usize, |depth, c| {
        *depth = match c {
            '(' => *depth + 1,
            ')' => depth.saturating_sub(1),
            _ => *depth,
        };
        Some(*depth)
    });
    if depth.max().unwrap_or(0) > DEEPEST {
        return Err(whole(format!("has more than {DEEPEST} nested brackets")));
    }
    let mut pairs = Grammar::parse(Rule::formula, text).map_err(refuse)?;
    match pairs.next().and_then(|formula| formula.into_inner().next()) {
        Some(sum) => expression(sum),
        None => Err(whole("is empty".to_owned())),
    }
}

/// The parser's error in words.
pub(super) fn refuse(error: pest::error::Error<Rule>) -> SyntaxError {
    let span = match error.location {
        InputLocation::Pos(at) => at..at,
        InputLocation::Span((from, to)) => from..to,
    };
    let problem = match &error.variant {
        ErrorVariant::ParsingError { positives, .. } => {
            let mut expected: Vec<&str> = positives.iter().map(|rule| in_words(*rule)).collect();
            expected.sort_unstable();
            expected.dedup();
            format!("expected {} here", expected.join(" or "))
        }
        ErrorVariant::CustomError { message } => message.clone(),
    };
    SyntaxError { problem, span }
}

fn in_words(rule: Rule) -> &'static str {
    match rule {
        Rule::number | Rule::name | Rule::call | Rule::negative | Rule::positive | Rule::sum => {
            "a number, a name or an opening bracket"
        }
        Rule::add | Rule::subtract | Rule::multiply | Rule::divide | Rule::power => "an operator (+ − * / ^)",
        Rule::EOI => "the end",
        Rule::one | Rule::symbol | Rule::factor | Rule::product => "a unit (mm, s, px, °C or 1)",
        Rule::times | Rule::over => "* or /",
        Rule::exponent | Rule::signed | Rule::superscript => "an exponent",
        _ => "a formula",
    }
}

fn expression(sum: Pair<'_, Rule>) -> Result<Expression, SyntaxError> {
    PRECEDENCE
        .map_primary(primary)
        .map_prefix(|operator, part| {
            let part = part?;
            let span = operator.as_span().start()..part.span.end;
            Ok(match operator.as_rule() {
                Rule::negative => Expression { node: Node::Negative(Box::new(part)), span },
                _ => part,
            })
        })
        .map_infix(|a, operator, b| {
            let (a, b) = (a?, b?);
            let operator = match operator.as_rule() {
                Rule::add => Operator::Add,
                Rule::subtract => Operator::Subtract,
                Rule::multiply => Operator::Multiply,
                Rule::divide => Operator::Divide,
                _ => Operator::Power,
            };
            let span = a.span.start..b.span.end;
            Ok(Expression { node: Node::Binary(operator, Box::new(a), Box::new(b)), span })
        })
        .parse(sum.into_inner())
}

fn primary(pair: Pair<'_, Rule>) -> Result<Expression, SyntaxError> {
    let span = pair.as_span().start()..pair.as_span().end();
    match pair.as_rule() {
        Rule::number => {
            let value: f64 = pair.as_str().parse().unwrap_or(f64::INFINITY);
            if !value.is_finite() {
                return Err(SyntaxError { problem: "this number is too large".to_owned(), span });
            }
            Ok(Expression { node: Node::Number(value), span })
        }
        Rule::name => Ok(Expression { node: Node::Name(pair.as_str().to_owned()), span }),
        Rule::call => call(pair, span),
        _ => expression(pair),
    }
}

fn call(pair: Pair<'_, Rule>, span: Range<usize>) -> Result<Expression, SyntaxError> {
    let mut parts = pair.into_inner();
    let name = parts.next().map_or("", |name| name.as_str());
    let Some(function) = Function::of(name) else {
        let known: Vec<&str> = Function::NAMES.iter().map(|(name, _)| *name).collect();
        let problem = format!("there is no function '{name}'; known are {}", known.join(", "));
        return Err(SyntaxError { problem, span: span.start..span.start + name.len() });
    };
    let arguments = parts.map(expression).collect::<Result<Vec<_>, _>>()?;
    let (expected, given) = (function.arguments(), arguments.len());
    if !expected.contains(&given) {
        let (fewest, most) = (*expected.start(), *expected.end());
        let expected = match most {
            1 => "1 argument".to_owned(),
            _ if fewest == most => format!("{most} arguments"),
            _ => format!("{fewest} to {most} arguments"),
        };
        let problem = format!("'{name}' takes {expected}, not {given}");
        return Err(SyntaxError { problem, span });
    }
    Ok(Expression { node: Node::Call(function, arguments), span })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expression with brackets around every operation.
    fn bracketed(e: &Expression) -> String {
        match &e.node {
            Node::Number(value) => value.to_string(),
            Node::Name(name) => name.clone(),
            Node::Negative(part) => format!("(-{})", bracketed(part)),
            Node::Binary(operator, a, b) => {
                let sign = match operator {
                    Operator::Add => '+',
                    Operator::Subtract => '-',
                    Operator::Multiply => '*',
                    Operator::Divide => '/',
                    Operator::Power => '^',
                };
                format!("({}{sign}{})", bracketed(a), bracketed(b))
            }
            Node::Call(function, parts) => {
                let parts: Vec<String> = parts.iter().map(bracketed).collect();
                format!("{}({})", function.name(), parts.join(","))
            }
        }
    }

    #[test]
    fn operators_bind_as_in_mathematics() {
        for (text, expected) in [
            ("a*y*log(rho / rho0)", "((a*y)*log((rho/rho0)))"),
            ("-x^2", "(-(x^2))"),
            ("2^-x", "(2^(-x))"),
            ("a - b - c", "((a-b)-c)"),
            ("a / b * c", "((a/b)*c)"),
            ("x ** 2 ^ 3", "(x^(2^3))"),
            ("+a − 1.5e-3", "(a-0.0015)"),
            ("min(a, max(b, -1))", "min(a,max(b,(-1)))"),
        ] {
            let expression = parse(text).unwrap_or_else(|e| panic!("{text}: {e:?}"));
            assert_eq!(bracketed(&expression), expected, "{text}");
        }
    }

    #[test]
    fn errors_say_where() {
        for (text, problem, span) in [
            ("a *", "a number, a name", 3..3),
            ("a b", "an operator", 2..2),
            ("sinus(x)", "no function 'sinus'", 0..5),
            ("min(x)", "takes 2 arguments, not 1", 0..6),
            ("spline(x, 0, 1, a)", "takes 7 to 67 arguments, not 4", 0..18),
            ("1e999", "too large", 0..5),
            ("", "a number", 0..0),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.problem.contains(problem), "{text}: {}", error.problem);
            assert_eq!(error.span, span, "{text}");
        }
        assert!(parse(&"(".repeat(200)).unwrap_err().problem.contains("nested"));
        assert!(parse(&"x+".repeat(800)).unwrap_err().problem.contains("longer"));
    }
}
