//! Formulas as Rust code.

use std::fmt::Write as _;

use depthcal_model::AddsTo;
use depthcal_model::hook::HookKind;

use crate::content::Content;
use crate::covariate::FormulaCovariate;
use crate::syntax::{Expression, Function, Node, Operator};

/// Rust code of a value: a plain number, or one of the type that carries derivatives.
struct Code {
    text: String,
    dual: bool,
}

impl Code {
    fn plain(text: impl Into<String>) -> Self {
        Self { text: text.into(), dual: false }
    }

    fn dual(text: impl Into<String>) -> Self {
        Self { text: text.into(), dual: true }
    }

    /// The value as one that carries derivatives.
    fn lifted(&self) -> String {
        if self.dual { self.text.clone() } else { format!("T::from({})", self.text) }
    }
}

/// Words that no name in Rust may be, and names that the file has already.
const RESERVED: [&str; 45] = [
    "as", "break", "const", "continue", "crate", "else", "enum", "extern", "false", "fn", "for", "if", "impl", "in",
    "let", "loop", "match", "mod", "move", "mut", "pub", "ref", "return", "self", "static", "struct", "super", "trait",
    "true", "type", "unsafe", "use", "where", "while", "async", "await", "dyn", "abstract", "become", "box", "final",
    "gen", "s", "c", "e",
];

/// A name of a formula as a name in Rust.
pub(super) fn identifier(name: &str) -> String {
    let usable = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if usable && !RESERVED.contains(&name) { name.to_owned() } else { format!("p_{}", ascii(name)) }
}

/// A name in small ASCII letters; other characters as their numbers.
pub(super) fn ascii(name: &str) -> String {
    name.chars().fold(String::new(), |mut text, c| {
        match c {
            c if c.is_ascii_alphanumeric() || c == '_' => text.push(c.to_ascii_lowercase()),
            c => _ = write!(text, "u{:x}", c as u32),
        }
        text
    })
}

/// A number as a Rust literal with a point.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    if value < 0.0 { format!("({text})") } else { text }
}

/// Code without brackets around the whole.
fn bare(text: &str) -> &str {
    let Some(inner) = text.strip_prefix('(').and_then(|t| t.strip_suffix(')')) else { return text };
    let mut depth = 0_i32;
    let closes_early = inner.chars().any(|c| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        depth < 0
    });
    if closes_early { text } else { inner }
}

/// The value of a covariate that is part of the context.
pub(super) fn context_value(covariate: FormulaCovariate, hook: HookKind) -> Option<&'static str> {
    use FormulaCovariate as C;
    match covariate {
        C::U | C::V if hook == HookKind::Pixel => None,
        C::U => Some("c.pixel[0]"),
        C::V => Some("c.pixel[1]"),
        C::Amplitude => Some("c.amplitude"),
        C::Surroundings => Some("c.surround"),
        C::Time => Some("c.time_s"),
        C::Temperature => Some("c.temperature_c"),
        _ => None,
    }
}

/// The value of a covariate; `None` where the state is destructured into names already.
pub(super) fn covariate_value(covariate: FormulaCovariate, hook: HookKind) -> Option<String> {
    use FormulaCovariate as C;
    if let Some(value) = context_value(covariate, hook) {
        return Some(value.to_owned());
    }
    let [x, y] = match hook {
        HookKind::Lens => ["s.x_true", "s.y_true"],
        HookKind::Depth => ["s.x", "s.y"],
        _ => return None,
    };
    match covariate {
        C::X => Some(x.to_owned()),
        C::Y => Some(y.to_owned()),
        // The root has no derivative at 0.
        C::R => Some(format!(
            "{{ let square = {x} * {x} + {y} * {y}; if square.re() > 0.0 {{ square.sqrt() }} else {{ square }} }}"
        )),
        C::Z => Some("s.rho.recip()".to_owned()),
        C::Rho => Some("s.rho".to_owned()),
        C::Range => Some(format!("({x} * {x} + {y} * {y} + 1.0).sqrt() / s.rho")),
        C::Incidence => Some("s.cos_incidence.recip() - 1.0".to_owned()),
        _ => None,
    }
}

/// The last lines of the map, the value of the last one is the result.
pub(super) fn result(content: &Content) -> Vec<String> {
    let codes: Vec<Code> = content.expressions.iter().map(|e| code(e, content)).collect();
    let e = |code: &Code| format!("let e = {};", bare(&code.lifted()));
    match (content.hook(), content.adds_to) {
        (HookKind::Depth, AddsTo::InverseDepth) => vec![e(&codes[0]), "s.rho + e".to_owned()],
        (HookKind::Depth, AddsTo::Depth) => vec![e(&codes[0]), "s.rho / (e * s.rho + 1.0)".to_owned()],
        (HookKind::Depth, _) => vec![e(&codes[0]), "s.rho / (e + 1.0)".to_owned()],
        (HookKind::Lens, AddsTo::Factor) => {
            vec![e(&codes[0]), "[s.x * (e + 1.0), s.y * (e + 1.0)]".to_owned()]
        }
        (hook, adds_to) => {
            let names: &[&str] = match hook {
                HookKind::Lens => &["s.x", "s.y"],
                HookKind::Pixel => &["u", "v"],
                _ => &["board_x", "board_y", "board_z"],
            };
            let first = match adds_to {
                AddsTo::Y | AddsTo::V => 1,
                AddsTo::Z => 2,
                _ => 0,
            };
            let parts =
                names.iter().enumerate().map(|(i, name)| match i.checked_sub(first).and_then(|k| codes.get(k)) {
                    Some(code) => format!("{name} + {}", code.lifted()),
                    None => (*name).to_owned(),
                });
            vec![format!("[{}]", parts.collect::<Vec<_>>().join(", "))]
        }
    }
}

/// The code of an expression.
fn code(expression: &Expression, content: &Content) -> Code {
    let code_of = |part: &Expression| code(part, content);
    match &expression.node {
        Node::Number(value) => Code::plain(number(*value)),
        Node::Name(name) => named(name, content),
        Node::Negative(part) => {
            let part = code_of(part);
            Code { text: format!("(-{})", part.text), dual: part.dual }
        }
        Node::Binary(operator, a, b) => binary(*operator, &code_of(a), &code_of(b)),
        Node::Call(function, parts) => call(*function, &parts.iter().map(code_of).collect::<Vec<_>>()),
    }
}

fn named(name: &str, content: &Content) -> Code {
    if content.definition.parameters.contains_key(name) {
        return Code::dual(identifier(name));
    }
    if content.definition.constants.contains_key(name) {
        return Code::plain(format!("self.{}", identifier(name)));
    }
    match FormulaCovariate::of(name) {
        Some(covariate) if context_value(covariate, content.hook()).is_some() => Code::plain(name),
        Some(_) => Code::dual(name),
        None => Code::plain("std::f64::consts::PI"),
    }
}

/// An operation: plain numbers stand on the right of those that carry derivatives.
fn binary(operator: Operator, a: &Code, b: &Code) -> Code {
    let (x, y) = (&a.text, &b.text);
    let whole = || y.trim_matches(['(', ')']).strip_suffix(".0").and_then(|n| n.parse::<i32>().ok());
    match (operator, a.dual, b.dual) {
        (Operator::Add, false, true) => Code::dual(format!("({y} + {x})")),
        (Operator::Subtract, false, true) => Code::dual(format!("(-{y} + {x})")),
        (Operator::Multiply, false, true) => Code::dual(format!("({y} * {x})")),
        (Operator::Divide, false, true) => Code::dual(format!("({y}.recip() * {x})")),
        (Operator::Power, true, true) => Code::dual(format!("{x}.powd({y})")),
        (Operator::Power, false, true) => Code::dual(format!("({y} * f64::ln({x})).exp()")),
        (Operator::Power, dual, false) => match whole() {
            Some(n) if dual => Code::dual(format!("{x}.powi({n})")),
            Some(n) => Code::plain(format!("f64::powi({x}, {n})")),
            None if dual => Code::dual(format!("{x}.powf({y})")),
            None => Code::plain(format!("f64::powf({x}, {y})")),
        },
        (operator, a_dual, _) => {
            let sign = match operator {
                Operator::Add => '+',
                Operator::Subtract => '-',
                Operator::Multiply => '*',
                _ => '/',
            };
            Code { text: format!("({x} {sign} {y})"), dual: a_dual || b.dual }
        }
    }
}

fn call(function: Function, parts: &[Code]) -> Code {
    let a = &parts[0];
    let re = |code: &Code| if code.dual { format!("{}.re()", code.text) } else { code.text.clone() };
    let step = || format!("f64::from(u8::from({} > 0.0))", re(a));
    match function {
        Function::Step => Code::plain(step()),
        Function::Hinge => Code { text: format!("({} * {})", a.text, step()), dual: a.dual },
        Function::Abs if a.dual => Code::dual(format!("({} * {}.signum())", a.text, re(a))),
        Function::Min | Function::Max => {
            let b = &parts[1];
            let sign = if function == Function::Min { '<' } else { '>' };
            let dual = a.dual || b.dual;
            let text = |code: &Code| if dual { code.lifted() } else { code.text.clone() };
            let choice = format!("if {} {sign} {} {{ {} }} else {{ {} }}", re(a), re(b), text(a), text(b));
            Code { text: format!("({choice})"), dual }
        }
        other => {
            let method = match other {
                Function::Log => "ln",
                named => named.name(),
            };
            match a.dual {
                true => Code::dual(format!("{}.{method}()", a.text)),
                // Numbers without a name have no type of their own.
                false => Code::plain(format!("f64::{method}({})", bare(&a.text))),
            }
        }
    }
}
