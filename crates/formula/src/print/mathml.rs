//! Formulas as MathML, which browsers typeset themselves.

use super::notation::{Notation, digits};
use super::symbol::Symbol;
use crate::syntax::{Function, Operator};

pub(super) struct MathMl;

/// Text without characters that mean something in HTML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Notation for MathMl {
    const BARS: bool = true;

    fn number(&self, value: f64) -> String {
        match digits(value) {
            (mantissa, None) => format!("<mn>{mantissa}</mn>"),
            (mantissa, Some(exponent)) => {
                let exponent = exponent.to_string().replace('-', "−");
                format!("<mrow><mn>{mantissa}</mn><mo>·</mo><msup><mn>10</mn><mn>{exponent}</mn></msup></mrow>")
            }
        }
    }
    fn name(&self, name: &str) -> String {
        let symbol = Symbol::of(name);
        let (base, index) = (escaped(&symbol.characters()), escaped(&symbol.index_characters()));
        if index.is_empty() {
            format!("<mi>{base}</mi>")
        } else {
            format!("<msub><mi>{base}</mi><mi>{index}</mi></msub>")
        }
    }
    fn bracketed(&self, inner: &str) -> String {
        format!("<mrow><mo>(</mo>{inner}<mo>)</mo></mrow>")
    }
    fn negative(&self, part: &str) -> String {
        format!("<mrow><mo>−</mo>{part}</mrow>")
    }
    fn binary(&self, operator: Operator, a: &str, b: &str) -> String {
        match operator {
            Operator::Add => format!("<mrow>{a}<mo>+</mo>{b}</mrow>"),
            Operator::Subtract => format!("<mrow>{a}<mo>−</mo>{b}</mrow>"),
            Operator::Multiply if b.starts_with("<mn>") => format!("<mrow>{a}<mo>·</mo>{b}</mrow>"),
            Operator::Multiply => format!("<mrow>{a}<mo>&#8290;</mo>{b}</mrow>"),
            Operator::Divide => format!("<mfrac>{a}{b}</mfrac>"),
            Operator::Power => format!("<msup>{a}{b}</msup>"),
        }
    }
    fn call(&self, function: Function, arguments: &[String]) -> String {
        let inner = format!("<mrow>{}</mrow>", arguments.join("<mo>,</mo>"));
        let name = match function {
            Function::Sqrt => return format!("<msqrt>{inner}</msqrt>"),
            Function::Abs => return format!("<mrow><mo>|</mo>{inner}<mo>|</mo></mrow>"),
            Function::Log => "ln",
            Function::Atan => "arctan",
            other => other.name(),
        };
        format!("<mrow><mi>{name}</mi><mo>&#8289;</mo><mo>(</mo>{inner}<mo>)</mo></mrow>")
    }
    fn comma(&self) -> &'static str {
        "<mo>,</mo>"
    }
}
