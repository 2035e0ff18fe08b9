//! Formulas as the Rust file of a piece.

use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, FormulaSearch};

use super::equation::equation;
use super::rust::{ascii, context_value, covariate_value, identifier, number, result};
use crate::content::Content;
use crate::covariate::FormulaCovariate;

/// The Rust file of a piece, in the form of those in `crates/model/src/HOOK/`.
pub(crate) fn piece_file(content: &Content) -> String {
    let mut file = PieceFile { content, hook: HookWords::of(content.hook()), text: String::new() };
    file.imports();
    file.constants();
    file.structure();
    file.implementation();
    file.text
}

/// Names and types of a hook in Rust.
struct HookWords {
    name: &'static str,
    /// The pattern of the map's argument, and its type.
    state: &'static str,
    state_type: &'static str,
    output_type: &'static str,
    /// The output of a map that changes nothing.
    unchanged: &'static str,
}

impl HookWords {
    fn of(hook: HookKind) -> Self {
        let (name, state, state_type, output_type, unchanged) = match hook {
            HookKind::Depth => ("Depth", "s", "DepthState<T>", "T", "s.rho"),
            HookKind::Lens => ("Lens", "s", "LensState<T>", "[T; 2]", "[s.x, s.y]"),
            HookKind::Pixel => ("Pixel", "[u, v]", "[T; 2]", "[T; 2]", "[u, v]"),
            HookKind::Board | HookKind::Pose => {
                ("Board", "[board_x, board_y, board_z]", "[T; 3]", "[T; 3]", "[board_x, board_y, board_z]")
            }
        };
        Self { name, state, state_type, output_type, unchanged }
    }
}

/// A file as it is written, from top to bottom.
struct PieceFile<'a> {
    content: &'a Content,
    hook: HookWords,
    text: String,
}

impl PieceFile<'_> {
    fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    /// The piece's type.
    fn kind(&self) -> String {
        type_name(&self.content.definition.name)
    }

    /// Covariates without which the piece has no value, as code.
    fn needs(&self) -> Vec<String> {
        self.content.covariates.iter().filter_map(|c| c.needs()).map(|c| format!("Covariate::{c:?}")).collect()
    }

    /// The variant of `On` for pieces that are formulated on one thing.
    fn form(&self) -> Option<&'static str> {
        match self.content.adds_to {
            AddsTo::InverseDepth => Some("InverseDepth"),
            AddsTo::Factor if self.content.hook() == HookKind::Depth => Some("Factor"),
            _ => None,
        }
    }

    fn imports(&mut self) {
        let constants = &self.content.definition.constants;
        let searched = constants.values().any(|constant| constant.search().is_some());
        let mut imports = vec!["Context", "Parameter", "Piece", "Scalar"];
        if !constants.is_empty() {
            imports.extend(["Constant", "Options"]);
        }
        if !self.needs().is_empty() || searched {
            imports.push("Covariate");
        }
        if searched {
            imports.push("ScanKind");
        }
        if self.form().is_some() {
            imports.push("On");
        }
        imports.sort_unstable();
        let name = self.hook.name;
        let hook = match self.hook.state_type.strip_suffix("<T>") {
            Some(state) => format!("{{{name}, {state}}}"),
            None => name.to_owned(),
        };
        self.line(&format!("use crate::hook::{hook};"));
        self.line(&format!("use crate::piece::{{{}}};", imports.join(", ")));
        self.line("");
    }

    /// The unit of a constant.
    fn unit(&self, constant: &str) -> &str {
        self.content.units_of_constants.get(constant).map_or("1", String::as_str)
    }

    fn constants(&mut self) {
        let content = self.content;
        for (name, constant) in &content.definition.constants {
            let unit = literal(self.unit(name));
            let label = literal(&name.replace('_', " "));
            let search = constant.search().zip(content.covariates.iter().find_map(|c| c.searched()));
            let search = search.map_or_else(String::new, |(kind, covariate)| {
                let kind = match kind {
                    FormulaSearch::Period => "Period",
                    FormulaSearch::TimeConstant => "TimeConstant",
                    FormulaSearch::Reference => "Reference",
                };
                format!(".searched(Covariate::{covariate:?}, ScanKind::{kind})")
            });
            let number = number(constant.value());
            self.line(&format!("const {}: Constant =", constant_name(name)));
            self.line(&format!("    Constant::new({}, {label}, {unit}, {number}){search};", literal(name)));
        }
        if !content.definition.constants.is_empty() {
            self.line("");
        }
    }

    /// The type, with its constants as fields and their values from options.
    fn structure(&mut self) {
        let constants = &self.content.definition.constants;
        let (summary, kind) = (self.content.summary(), self.kind());
        self.line(&format!("/// {}{}.", summary[..1].to_uppercase(), summary[1..].replace('\n', " ")));
        self.line("#[derive(Debug, Clone, Copy)]");
        if constants.is_empty() {
            self.line(&format!("pub struct {kind};"));
            self.line("");
            return;
        }
        self.line(&format!("pub struct {kind} {{"));
        for name in constants.keys() {
            let unit = self.unit(name);
            let unit = if unit == "1" { String::new() } else { format!(", {unit}") };
            self.line(&format!("    /// Constant {name} of the formula{unit}."));
            self.line(&format!("    pub {}: f64,", identifier(name)));
        }
        self.line("}");
        self.line("");
        self.line(&format!("impl {kind} {{"));
        self.line("    /// With the constants that are given by name, and defaults for the others.");
        self.line("    pub fn with_options(given: &Options) -> Self {");
        let field = |name: &String| format!("{}: {}.of(given)", identifier(name), constant_name(name));
        let fields: Vec<String> = constants.keys().map(field).collect();
        self.line(&format!("        Self {{ {} }}", fields.join(", ")));
        self.line("    }");
        self.line("}");
        self.line("");
    }

    fn implementation(&mut self) {
        let (hook, count, kind) = (self.hook.name, self.content.definition.parameters.len(), self.kind());
        self.line(&format!("impl Piece<{hook}, {count}> for {kind} {{"));
        self.metadata();
        self.line("");
        self.map();
        self.options();
        self.line("}");
    }

    fn metadata(&mut self) {
        let content = self.content;
        let definition = &content.definition;
        self.line(&format!("    const NAME: &'static str = {};", literal(&definition.name)));
        self.line(&format!("    const SUMMARY: &'static str = {};", literal(&content.summary())));
        self.line(&format!("    const EQUATION: &'static str = {};", literal(&equation(content))));
        self.line(&format!("    const SOURCE: &'static str = {};", literal(content.source())));
        self.line(&format!("    const PARAMETERS: [Parameter; {}] = [", definition.parameters.len()));
        for ((name, parameter), scale) in definition.parameters.iter().zip(&content.scales) {
            let table = parameter.table();
            self.line(&format!(
                "        Parameter::new({}, {}, {}, {}).meaning({}),",
                literal(name),
                literal(&table.unit),
                number(table.nominal),
                number(*scale),
                literal(&content.meaning_of(name))
            ));
        }
        self.line("    ];");
        if !definition.constants.is_empty() {
            let names: Vec<String> = definition.constants.keys().map(|name| constant_name(name)).collect();
            self.line(&format!("    const CONSTANTS: &'static [Constant] = &[{}];", names.join(", ")));
        }
        let needs = self.needs();
        if !needs.is_empty() {
            self.line(&format!("    const NEEDS: &'static [Covariate] = &[{}];", needs.join(", ")));
        }
        if let Some(form) = self.form() {
            self.line(&format!("    const FORM: On = On::{form};"));
        }
    }

    fn map(&mut self) {
        let (content, hook) = (self.content, self.content.hook());
        let parameters = &content.definition.parameters;
        let HookWords { state, state_type, output_type, unchanged, .. } = self.hook;
        let names: Vec<String> = parameters.keys().map(|name| identifier(name)).collect();
        let context = if content.covariates.iter().any(|c| context_value(*c, hook).is_some()) { "c" } else { "_" };
        self.line("    #[inline(always)]");
        self.line(&format!(
            "    fn map<T: Scalar>(&self, {state}: {state_type}, [{}]: [T; {}], {context}: &Context) -> {output_type} {{",
            names.join(", "),
            parameters.len()
        ));
        for covariate in content.covariates.iter().filter(|c| c.may_be_unknown()) {
            let value = context_value(*covariate, hook).unwrap_or("f64::NAN");
            let unknown = match covariate {
                FormulaCovariate::Temperature => format!("{value}.is_nan()"),
                _ => format!("!({value} > 0.0)"),
            };
            self.line(&format!("        if {unknown} {{"));
            self.line(&format!("            return {unchanged};"));
            self.line("        }");
        }
        for covariate in &content.covariates {
            if let Some(value) = covariate_value(*covariate, hook) {
                self.line(&format!("        let {} = {value};", covariate.name()));
            }
        }
        for text in result(content) {
            self.line(&format!("        {text}"));
        }
        self.line("    }");
    }

    fn options(&mut self) {
        let constants = &self.content.definition.constants;
        if constants.is_empty() {
            return;
        }
        let value = |name: &String| format!("({}.name, self.{})", constant_name(name), identifier(name));
        let values: Vec<String> = constants.keys().map(value).collect();
        self.line("    fn options(&self) -> Vec<(&'static str, f64)> {");
        self.line(&format!("        vec![{}]", values.join(", ")));
        self.line("    }");
    }
}

/// A constant of the formula as a constant in Rust.
fn constant_name(name: &str) -> String {
    ascii(name).to_uppercase()
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
