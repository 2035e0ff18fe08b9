//! Formulas as a line of text for terminals.

use super::notation::{Notation, digits};
use super::symbol::Symbol;
use crate::syntax::{Function, Operator};

pub(super) struct Text;

/// A whole number as raised or lowered characters; `None` where a character has no such form.
fn shifted(text: &str, characters: &str) -> Option<String> {
    let shifted = |c: char| match c {
        '-' => characters.chars().nth(10),
        c => characters.chars().nth(c.to_digit(10)? as usize),
    };
    text.chars().map(shifted).collect()
}

const RAISED: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻";
const LOWERED: &str = "₀₁₂₃₄₅₆₇₈₉₋";

impl Notation for Text {
    const BARS: bool = false;

    fn number(&self, value: f64) -> String {
        match digits(value) {
            (mantissa, None) => mantissa,
            (mantissa, Some(exponent)) => {
                format!("{mantissa}·10{}", shifted(&exponent.to_string(), RAISED).unwrap_or_default())
            }
        }
    }
    fn name(&self, name: &str) -> String {
        let symbol = Symbol::of(name);
        let index = symbol.index_characters();
        match shifted(&index, LOWERED) {
            Some(lowered) => symbol.characters() + &lowered,
            None => format!("{}_{index}", symbol.characters()),
        }
    }
    fn bracketed(&self, inner: &str) -> String {
        format!("({inner})")
    }
    fn negative(&self, part: &str) -> String {
        format!("−{part}")
    }
    fn binary(&self, operator: Operator, a: &str, b: &str) -> String {
        match operator {
            Operator::Add => format!("{a} + {b}"),
            Operator::Subtract => format!("{a} − {b}"),
            Operator::Multiply => format!("{a} {b}"),
            Operator::Divide => format!("{a}/{b}"),
            Operator::Power => match shifted(b, RAISED) {
                Some(raised) => format!("{a}{raised}"),
                None => format!("{a}^{b}"),
            },
        }
    }
    fn call(&self, function: Function, arguments: &[String]) -> String {
        let name = match function {
            Function::Log => "ln",
            Function::Sqrt => "√",
            other => other.name(),
        };
        match function {
            Function::Abs => format!("|{}|", arguments[0]),
            _ => format!("{name}({})", arguments.join(", ")),
        }
    }
}
