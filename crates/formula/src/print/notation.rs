//! Expressions in any notation: one walk that sets brackets, and a notation that sets the rest.

use crate::syntax::{Expression, Function, Node, Operator, SPLINE_RANGE};

/// How the parts of an expression are put together in print.
pub(super) trait Notation {
    /// Whether a quotient is a fraction with a bar, which needs no brackets around its parts.
    const BARS: bool;
    fn number(&self, value: f64) -> String;
    fn name(&self, name: &str) -> String;
    fn bracketed(&self, inner: &str) -> String;
    fn negative(&self, part: &str) -> String;
    fn binary(&self, operator: Operator, a: &str, b: &str) -> String;
    fn call(&self, function: Function, arguments: &[String]) -> String;
    /// Between two coordinates.
    fn comma(&self) -> &'static str {
        ", "
    }
}

/// How strongly an expression binds; the weaker one is put in brackets.
fn binding(expression: &Expression) -> u8 {
    match &expression.node {
        Node::Binary(Operator::Add | Operator::Subtract, ..) => 1,
        Node::Negative(_) => 2,
        Node::Binary(Operator::Multiply | Operator::Divide, ..) => 3,
        Node::Binary(Operator::Power, ..) => 4,
        Node::Number(_) | Node::Name(_) | Node::Call(..) => 5,
    }
}

/// The expression without the sign before its first factor, and whether there was one.
fn without_sign(expression: &Expression) -> (bool, Expression) {
    match &expression.node {
        Node::Negative(part) => (true, (**part).clone()),
        Node::Binary(operator @ (Operator::Multiply | Operator::Divide), a, b) => {
            let (negative, a) = without_sign(a);
            (negative, Expression { node: Node::Binary(*operator, Box::new(a), b.clone()), ..expression.clone() })
        }
        _ => (false, expression.clone()),
    }
}

/// `first + e` as one sum, without brackets around a sum and without two signs in a row.
pub(super) fn sum(first: Expression, e: &Expression) -> Expression {
    let combined = |operator: Operator, a: Expression, b: Expression| Expression {
        span: e.span.clone(),
        node: Node::Binary(operator, Box::new(a), Box::new(b)),
    };
    match &e.node {
        Node::Binary(operator @ (Operator::Add | Operator::Subtract), a, b) => {
            combined(*operator, sum(first, a), (**b).clone())
        }
        _ => match without_sign(e) {
            (true, rest) => combined(Operator::Subtract, first, rest),
            (false, rest) => combined(Operator::Add, first, rest),
        },
    }
}

/// An expression in a notation.
pub(super) fn write<N: Notation>(notation: &N, expression: &Expression) -> String {
    if let (Node::Binary(Operator::Multiply | Operator::Divide, ..), (true, positive)) =
        (&expression.node, without_sign(expression))
    {
        return notation.negative(&write(notation, &positive));
    }
    // A part in brackets where it binds less than `least`.
    let part = |inner: &Expression, least: u8| {
        let written = write(notation, inner);
        if binding(inner) < least { notation.bracketed(&written) } else { written }
    };
    match &expression.node {
        Node::Number(value) => notation.number(*value),
        Node::Name(name) => notation.name(name),
        Node::Negative(inner) => notation.negative(&part(inner, 3)),
        Node::Binary(operator, a, b) => {
            let (left, right) = match operator {
                Operator::Add => (1, 2),
                Operator::Subtract => (1, 3),
                Operator::Multiply => (3, 3),
                Operator::Divide if N::BARS => (0, 0),
                Operator::Divide => (3, 4),
                Operator::Power if N::BARS => (5, 0),
                Operator::Power => (5, 4),
            };
            // A fraction raised to a power looks as if only its top were raised.
            let left = if *operator == Operator::Power { left.max(5) } else { left };
            let right_part = match (&b.node, operator) {
                // a · (b / c) reads as (a b) / c, which is the same.
                (Node::Binary(Operator::Divide, ..), Operator::Multiply) if !N::BARS => part(b, 4),
                _ => part(b, right),
            };
            notation.binary(*operator, &part(a, left), &right_part)
        }
        Node::Call(function, parts) => {
            let mut arguments: Vec<String> = parts.iter().map(|inner| write(notation, inner)).collect();
            // Many coefficients say nothing that the first and the last do not.
            if *function == Function::Spline {
                arguments.splice(SPLINE_RANGE + 1..arguments.len() - 1, [notation.name("…")]);
            }
            notation.call(*function, &arguments)
        }
    }
}

/// A number in print: decimal where that is short, else a mantissa and a power of ten.
pub(super) fn digits(value: f64) -> (String, Option<i32>) {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        return (format!("{value}"), None);
    }
    let text = format!("{value:e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => (mantissa.to_owned(), exponent.parse().ok()),
        None => (text, None),
    }
}
