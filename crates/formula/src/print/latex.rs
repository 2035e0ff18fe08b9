//! Formulas as LaTeX.

use super::notation::{Notation, digits};
use super::symbol::Symbol;
use crate::syntax::{Function, Operator};

pub(super) struct Latex;

fn letters(text: &str) -> String {
    match Symbol::greek_name(text) {
        Some(name) => format!("\\{name}"),
        None if text == "Ā" => "\\bar{A}".to_owned(),
        None if text.chars().count() == 1 => text.to_owned(),
        None => format!("\\mathrm{{{}}}", text.replace('_', "\\_")),
    }
}

impl Notation for Latex {
    const BARS: bool = true;

    fn number(&self, value: f64) -> String {
        match digits(value) {
            (mantissa, None) => mantissa,
            (mantissa, Some(exponent)) => format!("{mantissa} \\cdot 10^{{{exponent}}}"),
        }
    }
    fn name(&self, name: &str) -> String {
        let symbol = Symbol::of(name);
        let index = if symbol.index.chars().all(|c| c.is_ascii_digit()) {
            symbol.index.clone()
        } else {
            letters(&symbol.index)
        };
        let base = letters(&symbol.letters);
        if index.is_empty() { base } else { format!("{base}_{{{index}}}") }
    }
    fn bracketed(&self, inner: &str) -> String {
        format!("\\left({inner}\\right)")
    }
    fn negative(&self, part: &str) -> String {
        format!("-{part}")
    }
    fn binary(&self, operator: Operator, a: &str, b: &str) -> String {
        match operator {
            Operator::Add => format!("{a} + {b}"),
            Operator::Subtract => format!("{a} - {b}"),
            // Two numbers side by side would be one.
            Operator::Multiply if b.starts_with(|c: char| c.is_ascii_digit()) => format!("{a} \\cdot {b}"),
            Operator::Multiply => format!("{a} \\, {b}"),
            Operator::Divide => format!("\\frac{{{a}}}{{{b}}}"),
            Operator::Power => format!("{a}^{{{b}}}"),
        }
    }
    fn call(&self, function: Function, arguments: &[String]) -> String {
        let inner = arguments.join(", ");
        match function {
            Function::Sqrt => format!("\\sqrt{{{inner}}}"),
            Function::Abs => format!("\\left|{inner}\\right|"),
            Function::Step => format!("\\theta\\left({inner}\\right)"),
            Function::Hinge => format!("\\left({inner}\\right)_{{+}}"),
            Function::Log => format!("\\ln\\left({inner}\\right)"),
            Function::Atan => format!("\\arctan\\left({inner}\\right)"),
            Function::Spline => format!("\\mathrm{{spline}}\\left({inner}\\right)"),
            other => format!("\\{}\\left({inner}\\right)", other.name()),
        }
    }
}
