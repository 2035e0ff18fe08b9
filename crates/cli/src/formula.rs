//! `formula`: what a file of formulas says, and the same in other forms.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use depthcal_formula::FormulaEffect;
use depthcal_io::write_atomically;
use depthcal_model::hook::HookKind;
use depthcal_report::format::number;
use depthcal_report::formula_plot;
use serde_json::{Value, json};

use super::common::read_formulas;
use super::failure::{Failure, input};
use super::voice::{self, say};

/// Checks a file of formulas and shows its effects: equations, covariates, parameters with units.
///
/// With --rust, --latex or --plot it writes the effects in these forms, to standard output or into --out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal formula row_gain.toml                              is it right? what are its units?
  depthcal formula row_gain.toml --rust > row_gain.rs         a Rust file that adds it to a program
  depthcal formula effects.toml --latex --plot --out paper/   NAME.tex and NAME.svg of every effect
  depthcal calibrate captures/ --with row_gain.toml --out r/  fits it")]
pub(super) struct Formula {
    /// A TOML file with one [[effect]] for each formula; docs/formulas.md describes it.
    file: PathBuf,
    /// Only the effect of this name.
    #[arg(long, value_name = "NAME")]
    effect: Option<String>,
    /// A Rust file that adds the effects to the register of a program.
    #[arg(long)]
    rust: bool,
    /// The equation as LaTeX, without dollar signs.
    #[arg(long)]
    latex: bool,
    /// An SVG picture of the effect over its covariates, with its parameters at their typical sizes.
    #[arg(long)]
    plot: bool,
    /// Folder for the files; standard output otherwise.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Formula {
    pub(super) fn run(&self) -> Result<Value, Failure> {
        let mut effects = read_formulas(&self.file)?;
        if let Some(name) = &self.effect {
            let known: Vec<String> = effects.iter().map(|effect| effect.name().to_owned()).collect();
            effects.retain(|effect| effect.name() == name);
            if effects.is_empty() {
                return Err(Failure::Input(format!(
                    "--effect {name}: {} has {}",
                    self.file.display(),
                    known.join(", ")
                )));
            }
        }
        let mut written = Vec::new();
        let mut forms: Vec<(&str, Form)> = Vec::new();
        if self.rust {
            forms.push(("rs", FormulaEffect::rust));
        }
        if self.latex {
            forms.push(("tex", |effect| effect.latex() + "\n"));
        }
        if self.plot {
            forms.push(("svg", formula_plot));
        }
        for effect in &effects {
            if forms.is_empty() {
                say!("{}", description(effect));
            }
            for (ending, form) in &forms {
                let text = form(effect);
                match &self.out {
                    None => voice::document(text.as_bytes()),
                    Some(out) => {
                        let path = out.join(format!("{}.{ending}", effect.name()));
                        write_atomically(&path, |file| file.write_all(text.as_bytes())).map_err(input)?;
                        say!("written: {}", path.display());
                        written.push(path);
                    }
                }
            }
        }
        let described = effects.iter().map(|effect| {
            json!({
                "name": effect.name(),
                "equation": effect.text(),
                "latex": effect.latex(),
                "covariates": effect.covariates().iter().map(|c| c.name()).collect::<Vec<_>>(),
                "definition": effect.definition(),
                "units_of_constants": effect.units_of_constants(),
                "scales": effect.scales(),
            })
        });
        Ok(json!({ "effects": described.collect::<Vec<_>>(), "written": written }))
    }
}

/// A form of an effect as text.
type Form = fn(&FormulaEffect) -> String;

/// An effect in words.
fn description(effect: &FormulaEffect) -> String {
    let definition = effect.definition();
    let (quantity, state) = match effect.hook() {
        HookKind::Depth => ("measured depth", format!(", of the {} state", definition.of.name())),
        HookKind::Lens => ("normalised image coordinates", String::new()),
        HookKind::Pixel => ("pixel of the depth image", String::new()),
        HookKind::Board | HookKind::Pose => ("point of the board", String::new()),
    };
    let mut text = format!("{}\n  {quantity}: {}{state}\n", effect.name(), effect.text());
    let list = |text: &mut String, title: &str, items: Vec<String>| {
        for (i, item) in items.iter().enumerate() {
            let _ = writeln!(text, "  {:11} {item}", if i == 0 { title } else { "" });
        }
    };
    list(
        &mut text,
        "covariates:",
        effect.covariates().iter().map(|c| format!("{}, {}", c.name(), c.words())).collect(),
    );
    let parameters = definition.parameters.iter().zip(effect.scales());
    let parameters = parameters.map(|((name, parameter), scale)| {
        let table = parameter.table();
        format!("{name} in {}, nominal {}, typical {}", table.unit, number(table.nominal), number(*scale))
    });
    list(&mut text, "parameters:", parameters.collect());
    let constants = definition.constants.iter().map(|(name, constant)| {
        let unit = effect.units_of_constants().get(name).map_or("1", String::as_str);
        format!("{name} = {} {unit}", number(constant.value()))
    });
    list(&mut text, "constants:", constants.collect());
    text
}
