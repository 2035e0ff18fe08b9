//! Effects of a caller: formulas, and numpy functions.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use depthcal_formula::{FormulaCovariate, FormulaEffect, FormulaFile, file_text};
use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, AnyPiece, FormulaDefinition, Of, Parameter, PieceSpec, Placement, Register};
use pyo3::prelude::*;

use crate::failure::{Failure, input};
use crate::function_piece::{FunctionContent, FunctionPiece, text};

/// An effect that a caller brings.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Effect(Kind);

#[derive(Debug)]
enum Kind {
    Formula(Box<FormulaEffect>),
    Function(Arc<FunctionContent>, Of),
}

/// A parameter: name, unit, nominal value, typical deviation, meaning.
type ParameterOf = (String, String, f64, f64, String);

impl Effect {
    pub fn of_formula(effect: FormulaEffect) -> Self {
        Self(Kind::Formula(Box::new(effect)))
    }

    /// Adds the effect to a register.
    pub fn register(&self, register: &mut Register) -> Result<(), Failure> {
        match &self.0 {
            Kind::Formula(effect) => effect.register(register).map_err(input),
            Kind::Function(content, _) => {
                if Register::builtin().find(content.name).is_some() {
                    return Err(input(format!(
                        "effect '{}': a piece of depthcal has this name: choose another",
                        content.name
                    )));
                }
                let piece: Arc<dyn AnyPiece> = Arc::new(FunctionPiece::new(content.clone()));
                register.add_any(content.name, HookKind::Depth, move |_| piece.clone());
                Ok(())
            }
        }
    }
}

#[pymethods]
impl Effect {
    /// The effects of a file of formulas.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Vec<Self>> {
        Ok(FormulaFile::read(&path).map_err(input)?.effects().iter().cloned().map(Self::of_formula).collect())
    }

    /// An effect from the JSON text of its definition.
    #[staticmethod]
    fn formula(definition: &str) -> PyResult<Self> {
        let definition: FormulaDefinition =
            serde_json::from_str(definition).map_err(|e| input(format!("effect: {e}")))?;
        Ok(Self::of_formula(FormulaEffect::new(definition).map_err(input)?))
    }

    /// An effect from a function (values of the parameters, arrays of the covariates) → array of float64.
    #[staticmethod]
    #[pyo3(signature = (name, function, covariates, parameters, adds_to, of, summary, source))]
    #[expect(clippy::too_many_arguments, reason = "called by one Python function, which names them")]
    fn function(
        name: &str,
        function: Py<PyAny>,
        covariates: Vec<String>,
        parameters: Vec<ParameterOf>,
        adds_to: &str,
        of: &str,
        summary: &str,
        source: &str,
    ) -> PyResult<Self> {
        let known = FormulaCovariate::at(HookKind::Depth);
        let covariate = |name: &String| {
            let covariate = FormulaCovariate::of(name).filter(|covariate| covariate.is_known_at(HookKind::Depth));
            let names = || known.iter().map(|c| c.name()).collect::<Vec<_>>().join(", ");
            covariate.ok_or_else(|| input(format!("'{name}' is no covariate of depth; known are {}", names())))
        };
        let covariates = covariates.iter().map(covariate).collect::<Result<Vec<_>, Failure>>()?;
        let adds_to = match adds_to {
            "depth" => AddsTo::Depth,
            "inverse_depth" => AddsTo::InverseDepth,
            "factor" => AddsTo::Factor,
            other => return Err(input(format!("adds_to is '{other}': give depth, inverse_depth or factor")).into()),
        };
        let state = of.parse::<Of>().map_err(|_| input(format!("of is '{of}': give true or measured")))?;
        let parameters = parameters.into_iter().map(|(name, unit, nominal, scale, meaning)| Parameter {
            meaning: text(&meaning),
            ..Parameter::new(text(&name), text(&unit), nominal, scale)
        });
        let content = FunctionContent::new(
            text(name),
            text(summary),
            text(source),
            parameters.collect(),
            adds_to,
            covariates,
            function,
        );
        Ok(Self(Kind::Function(Arc::new(content), state)))
    }

    #[getter]
    fn name(&self) -> &str {
        match &self.0 {
            Kind::Formula(effect) => effect.name(),
            Kind::Function(content, _) => content.name,
        }
    }

    /// Its name with its place, as models are written.
    #[getter]
    fn spec(&self) -> String {
        match &self.0 {
            Kind::Formula(effect) => effect.spec().to_string(),
            Kind::Function(content, of) => {
                PieceSpec::new(content.name).placed(Placement { of: *of, on: None }).to_string()
            }
        }
    }

    /// Whether it is a formula, which files carry whole.
    #[getter]
    fn is_formula(&self) -> bool {
        matches!(self.0, Kind::Formula(_))
    }

    /// The equation; empty for a function.
    #[getter]
    fn equation(&self) -> String {
        match &self.0 {
            Kind::Formula(effect) => effect.text(),
            Kind::Function(..) => String::new(),
        }
    }

    /// The equation as LaTeX; empty for a function.
    #[getter]
    fn latex(&self) -> String {
        match &self.0 {
            Kind::Formula(effect) => effect.latex(),
            Kind::Function(..) => String::new(),
        }
    }

    /// (name, unit, nominal value, typical deviation) of its parameters.
    #[getter]
    fn parameters(&self) -> Vec<(String, String, f64, f64)> {
        match &self.0 {
            Kind::Formula(effect) => {
                let all = effect.definition().parameters.iter().zip(effect.scales());
                let row = |((name, parameter), scale): ((&String, &depthcal_model::FormulaParameter), &f64)| {
                    let table = parameter.table();
                    (name.clone(), table.unit, table.nominal, *scale)
                };
                all.map(row).collect()
            }
            Kind::Function(content, _) => {
                let row = |p: &Parameter| (p.name.to_string(), p.unit.to_owned(), p.nominal, p.scale);
                content.parameters.iter().map(row).collect()
            }
        }
    }

    /// A file of formulas with this effect; an error for a function.
    fn toml(&self) -> PyResult<String> {
        match &self.0 {
            Kind::Formula(effect) => Ok(file_text(std::slice::from_ref(effect))),
            Kind::Function(content, _) => {
                Err(input(format!("effect '{}' is a function of Python, which has no file", content.name)).into())
            }
        }
    }

    /// Calls of the function so far, points that it was called for, and seconds within it; zeros for a formula.
    #[getter]
    fn cost(&self) -> (u64, u64, f64) {
        match &self.0 {
            Kind::Formula(_) => (0, 0, 0.0),
            Kind::Function(content, _) => {
                let [calls, points, nanoseconds] = [&content.calls, &content.points, &content.nanoseconds]
                    .map(|counter| counter.load(Ordering::Relaxed));
                (calls, points, nanoseconds as f64 * 1e-9)
            }
        }
    }
}
