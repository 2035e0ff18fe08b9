//! Formulas as the Rust file of a piece.

use std::fmt::Write as _;

use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, FormulaSearch};

use super::equation::equation;
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
fn identifier(name: &str) -> String {
    let usable = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if usable && !RESERVED.contains(&name) { name.to_owned() } else { format!("p_{}", ascii(name)) }
}

/// A name in small ASCII letters; other characters as their numbers.
fn ascii(name: &str) -> String {
    name.chars().fold(String::new(), |mut text, c| {
        match c {
            c if c.is_ascii_alphanumeric() || c == '_' => text.push(c.to_ascii_lowercase()),
            c => _ = write!(text, "u{:x}", c as u32),
        }
        text
    })
}

/// `row_gain` as `RowGain`.
fn type_name(name: &str) -> String {
    let capital = |part: &str| {
        let mut letters = part.chars();
        letters.next().map_or_else(String::new, |first| first.to_ascii_uppercase().to_string() + letters.as_str())
    };
    name.split('_').map(capital).collect()
}

/// A text as a Rust literal.
fn literal(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', " "))
}

/// A number as a Rust literal with a point.
fn number(value: f64) -> String {
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

/// The Rust file of a piece, in the form of those in `crates/model/src/HOOK/`.
pub(crate) fn piece_file(content: &Content) -> String {
    let definition = &content.definition;
    let (hook, constants) = (content.hook(), &definition.constants);
    let kind = type_name(&definition.name);
    let parameters: Vec<&String> = definition.parameters.keys().collect();
    let count = parameters.len();
    let (hook_name, state, state_type, output_type) = match hook {
        HookKind::Depth => ("Depth", "s", "DepthState<T>", "T"),
        HookKind::Lens => ("Lens", "s", "LensState<T>", "[T; 2]"),
        HookKind::Pixel => ("Pixel", "[u, v]", "[T; 2]", "[T; 2]"),
        HookKind::Board | HookKind::Pose => ("Board", "[board_x, board_y, board_z]", "[T; 3]", "[T; 3]"),
    };
    let state_import = state_type.strip_suffix("<T>").map_or_else(String::new, |name| format!(", {name}"));
    let needs: Vec<String> =
        content.covariates.iter().filter_map(|c| c.needs()).map(|c| format!("Covariate::{c:?}")).collect();
    let searched = constants.values().any(|constant| constant.search().is_some());
    let form = match content.adds_to {
        AddsTo::InverseDepth => Some("InverseDepth"),
        AddsTo::Factor if hook == HookKind::Depth => Some("Factor"),
        _ => None,
    };
    let mut imports = vec!["Context", "Parameter", "Piece", "Scalar"];
    if !constants.is_empty() {
        imports.extend(["Constant", "Options"]);
    }
    if !needs.is_empty() || searched {
        imports.push("Covariate");
    }
    if searched {
        imports.push("ScanKind");
    }
    if form.is_some() {
        imports.push("On");
    }
    imports.sort_unstable();

    let mut file = String::new();
    let mut line = |text: &str| {
        file.push_str(text);
        file.push('\n');
    };
    line(&format!(
        "use crate::hook::{};",
        if state_import.is_empty() { hook_name.to_owned() } else { format!("{{{hook_name}{state_import}}}") }
    ));
    line(&format!("use crate::piece::{{{}}};", imports.join(", ")));
    line("");
    for (name, constant) in constants {
        let unit = content.units_of_constants.get(name).map_or("1", String::as_str);
        let label = name.replace('_', " ");
        let search = constant.search().zip(content.covariates.iter().find_map(|c| c.searched()));
        let search = search.map_or_else(String::new, |(kind, covariate)| {
            let kind = match kind {
                FormulaSearch::Period => "Period",
                FormulaSearch::TimeConstant => "TimeConstant",
                FormulaSearch::Reference => "Reference",
            };
            format!(".searched(Covariate::{covariate:?}, ScanKind::{kind})")
        });
        line(&format!("const {}: Constant =", ascii(name).to_uppercase()));
        let number = number(constant.value());
        line(&format!(
            "    Constant::new({}, {}, {}, {number}){search};",
            literal(name),
            literal(&label),
            literal(unit)
        ));
    }
    if !constants.is_empty() {
        line("");
    }
    let summary = content.summary();
    line(&format!("/// {}{}.", summary[..1].to_uppercase(), summary[1..].replace('\n', " ")));
    line("#[derive(Debug, Clone, Copy)]");
    if constants.is_empty() {
        line(&format!("pub struct {kind};"));
    } else {
        line(&format!("pub struct {kind} {{"));
        for name in constants.keys() {
            let unit = content.units_of_constants.get(name).map_or("1", String::as_str);
            let unit = if unit == "1" { String::new() } else { format!(", {unit}") };
            line(&format!("    /// Constant {name} of the formula{unit}."));
            line(&format!("    pub {}: f64,", identifier(name)));
        }
        line("}");
        line("");
        line(&format!("impl {kind} {{"));
        line("    /// With the constants that are given by name, and defaults for the others.");
        line("    pub fn with_options(given: &Options) -> Self {");
        let fields: Vec<String> = constants
            .keys()
            .map(|name| format!("{}: {}.of(given)", identifier(name), ascii(name).to_uppercase()))
            .collect();
        line(&format!("        Self {{ {} }}", fields.join(", ")));
        line("    }");
        line("}");
    }
    line("");
    line(&format!("impl Piece<{hook_name}, {count}> for {kind} {{"));
    line(&format!("    const NAME: &'static str = {};", literal(&definition.name)));
    line(&format!("    const SUMMARY: &'static str = {};", literal(&summary)));
    line(&format!("    const EQUATION: &'static str = {};", literal(&equation(content))));
    line(&format!("    const SOURCE: &'static str = {};", literal(content.source())));
    line(&format!("    const PARAMETERS: [Parameter; {count}] = ["));
    for ((name, parameter), scale) in definition.parameters.iter().zip(&content.scales) {
        let table = parameter.table();
        line(&format!(
            "        Parameter::new({}, {}, {}, {}).meaning({}),",
            literal(name),
            literal(&table.unit),
            number(table.nominal),
            number(*scale),
            literal(&content.meaning_of(name))
        ));
    }
    line("    ];");
    if !constants.is_empty() {
        let names: Vec<String> = constants.keys().map(|name| ascii(name).to_uppercase()).collect();
        line(&format!("    const CONSTANTS: &'static [Constant] = &[{}];", names.join(", ")));
    }
    if !needs.is_empty() {
        line(&format!("    const NEEDS: &'static [Covariate] = &[{}];", needs.join(", ")));
    }
    if let Some(form) = form {
        line(&format!("    const FORM: On = On::{form};"));
    }
    line("");
    line("    #[inline(always)]");
    let names: Vec<String> = parameters.iter().map(|name| identifier(name)).collect();
    let context = if content.covariates.iter().any(|c| context_value(*c, hook).is_some()) { "c" } else { "_" };
    line(&format!(
        "    fn map<T: Scalar>(&self, {state}: {state_type}, [{}]: [T; {count}], {context}: &Context) -> {output_type} {{",
        names.join(", ")
    ));
    let unchanged = match hook {
        HookKind::Depth => "s.rho",
        HookKind::Lens => "[s.x, s.y]",
        other => return_state(other),
    };
    for covariate in content.covariates.iter().filter(|c| c.may_be_unknown()) {
        let value = context_value(*covariate, hook).unwrap_or("f64::NAN");
        let unknown = match covariate {
            FormulaCovariate::Temperature => format!("{value}.is_nan()"),
            _ => format!("!({value} > 0.0)"),
        };
        line(&format!("        if {unknown} {{"));
        line(&format!("            return {unchanged};"));
        line("        }");
    }
    for covariate in &content.covariates {
        if let Some(value) = covariate_value(*covariate, hook) {
            line(&format!("        let {} = {value};", covariate.name()));
        }
    }
    for text in result(content) {
        line(&format!("        {text}"));
    }
    line("    }");
    if !constants.is_empty() {
        line("    fn options(&self) -> Vec<(&'static str, f64)> {");
        let values: Vec<String> =
            constants.keys().map(|n| format!("({}.name, self.{})", ascii(n).to_uppercase(), identifier(n))).collect();
        line(&format!("        vec![{}]", values.join(", ")));
        line("    }");
    }
    line("}");
    file
}

fn return_state(hook: HookKind) -> &'static str {
    match hook {
        HookKind::Pixel => "[u, v]",
        _ => "[board_x, board_y, board_z]",
    }
}

/// The value of a covariate that is part of the context.
fn context_value(covariate: FormulaCovariate, hook: HookKind) -> Option<&'static str> {
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
fn covariate_value(covariate: FormulaCovariate, hook: HookKind) -> Option<String> {
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

/// The last lines of the map.
fn result(content: &Content) -> Vec<String> {
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
    let of = |part: &Expression| code(part, content);
    match &expression.node {
        Node::Number(value) => Code::plain(number(*value)),
        Node::Name(name) => named(name, content),
        Node::Negative(part) => {
            let part = of(part);
            Code { text: format!("(-{})", part.text), dual: part.dual }
        }
        Node::Binary(operator, a, b) => binary(*operator, &of(a), &of(b)),
        Node::Call(function, parts) => call(*function, &parts.iter().map(of).collect::<Vec<_>>()),
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
