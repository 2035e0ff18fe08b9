//! A formula as a piece of the chain.

use std::borrow::Cow;
use std::sync::Arc;

use depthcal_model::hook::HookKind;
use depthcal_model::{
    AddsTo, AnyPiece, Constant, Context, Covariate, FormulaDefinition, FormulaSearch, On, Options, Parameter, ScanKind,
    SmoothParameters,
};

use crate::content::Content;
use crate::covariate::FormulaCovariate;
use crate::graph::{Graph, Id, Input, Tape};
use crate::intern;
use crate::lowering::{lower, outputs};
use crate::print;

/// A formula with the values of its constants. Where a covariate of an observation is unknown, nothing is added.
#[derive(Debug)]
pub(crate) struct FormulaPiece {
    content: Arc<Content>,
    parameters: Vec<Parameter>,
    constants: Vec<Constant>,
    options: Options,
    needs: &'static [Covariate],
    summary: &'static str,
    equation: &'static str,
    source: &'static str,
    /// Covariates of its formula that an observation may lack.
    may_lack: Vec<FormulaCovariate>,
    inputs: usize,
    outputs: usize,
    /// The outputs.
    value: Tape,
    /// The outputs, then their derivatives by the state, row by row.
    by_state: Tape,
    /// The outputs, then their derivatives by the state, then those by the parameters, row by row.
    by_all: Tape,
    /// The derivatives by the parameters.
    by_theta: Tape,
}

impl FormulaPiece {
    pub fn new(content: &Arc<Content>, given: &Options) -> Self {
        let definition = &content.definition;
        let options: Options = definition
            .constants
            .iter()
            .map(|(name, c)| (name.clone(), given.get(name).copied().unwrap_or(c.value())))
            .collect();
        let hook = content.hook();
        let inputs = match hook {
            HookKind::Lens => 5,
            HookKind::Depth => 4,
            HookKind::Pixel => 2,
            HookKind::Board | HookKind::Pose => 3,
        };
        let mut graph = Graph::default();
        let meaning = content.meaning(&options);
        let values: Vec<Id> = content.expressions.iter().map(|e| lower(&mut graph, hook, e, &meaning)).collect();
        let out = outputs(&mut graph, hook, content.adds_to, &values);
        let mut derivatives = |inputs: &[Input]| -> Vec<Id> {
            out.iter().flat_map(|o| inputs.iter().map(|i| graph.derivative(*o, *i)).collect::<Vec<_>>()).collect()
        };
        let by_state = derivatives(&(0..inputs).map(|i| Input::State(i as u8)).collect::<Vec<_>>());
        let by_theta = derivatives(&(0..content.nominal().len()).map(|i| Input::Theta(i as u16)).collect::<Vec<_>>());
        let tape = |parts: &[&[Id]]| Tape::new(&graph, &parts.concat());
        let mut needs: Vec<Covariate> = content.covariates.iter().filter_map(|c| c.needs()).collect();
        needs.dedup();
        Self {
            parameters: parameters(content),
            constants: constants(content),
            needs: intern::covariates(&needs),
            summary: intern::text(&content.summary()),
            equation: intern::text(&print::equation(content)),
            source: intern::text(content.source()),
            may_lack: content.covariates.iter().copied().filter(|c| c.may_be_unknown()).collect(),
            inputs,
            outputs: out.len(),
            value: tape(&[&out]),
            by_state: tape(&[&out, &by_state]),
            by_all: tape(&[&out, &by_state, &by_theta]),
            by_theta: tape(&[&by_theta]),
            options,
            content: content.clone(),
        }
    }

    /// Whether an observation has all covariates.
    #[inline]
    fn knows(&self, context: &Context) -> bool {
        self.may_lack.iter().all(|covariate| !covariate.of_context(context).is_nan())
    }

    /// Puts the identity where an observation lacks a covariate.
    fn undo(
        &self,
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        mut d_state: Option<&mut [f64]>,
        mut d_theta: Option<&mut [f64]>,
    ) {
        if self.may_lack.is_empty() {
            return;
        }
        let (inputs, outputs, count) = (self.inputs, self.outputs, self.parameters.len());
        // The states' numbers that the outputs are where nothing is added.
        let first = match self.content.hook() {
            HookKind::Lens => 3,
            HookKind::Depth => 2,
            _ => 0,
        };
        for (k, _) in contexts.iter().enumerate().filter(|(_, context)| !self.knows(context)) {
            for o in 0..outputs {
                out[k * outputs + o] = states[k * inputs + first + o];
                let row = k * outputs + o;
                if let Some(d_state) = d_state.as_deref_mut() {
                    let d = &mut d_state[row * inputs..][..inputs];
                    d.fill(0.0);
                    d[first + o] = 1.0;
                }
                if let Some(d_theta) = d_theta.as_deref_mut() {
                    d_theta[row * count..][..count].fill(0.0);
                }
            }
        }
    }
}

fn parameters(content: &Content) -> Vec<Parameter> {
    let all = content.definition.parameters.iter().zip(&content.scales);
    all.map(|((name, parameter), scale)| {
        let table = parameter.table();
        Parameter {
            name: Cow::Owned(name.clone()),
            unit: intern::text(&table.unit),
            nominal: table.nominal,
            scale: *scale,
            meaning: intern::text(&content.meaning_of(name)),
        }
    })
    .collect()
}

fn constants(content: &Content) -> Vec<Constant> {
    let covariate = content.covariates.iter().find_map(|c| c.searched());
    let all = content.definition.constants.iter();
    all.map(|(name, constant)| {
        let unit = content.units_of_constants.get(name).map_or("1", String::as_str);
        let name = intern::text(name);
        let declared = Constant::new(name, intern::text(&name.replace('_', " ")), intern::text(unit), constant.value());
        let kind = constant.search().map(|search| match search {
            FormulaSearch::Period => ScanKind::Period,
            FormulaSearch::TimeConstant => ScanKind::TimeConstant,
            FormulaSearch::Reference => ScanKind::Reference,
        });
        match (kind, covariate) {
            (Some(kind), Some(covariate)) => declared.searched(covariate, kind),
            _ => declared,
        }
    })
    .collect()
}

impl AnyPiece for FormulaPiece {
    fn name(&self) -> &'static str {
        intern::text(&self.content.definition.name)
    }
    fn summary(&self) -> &'static str {
        self.summary
    }
    fn equation(&self) -> &'static str {
        self.equation
    }
    fn source(&self) -> &'static str {
        self.source
    }
    fn hook(&self) -> HookKind {
        self.content.hook()
    }
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn constants(&self) -> Vec<Constant> {
        self.constants.clone()
    }
    fn options(&self) -> Options {
        self.options.clone()
    }
    fn needs(&self) -> &'static [Covariate] {
        self.needs
    }
    fn form(&self) -> On {
        match self.content.adds_to {
            AddsTo::InverseDepth => On::InverseDepth,
            AddsTo::Factor => On::Factor,
            _ => On::Depth,
        }
    }
    fn smooth(&self) -> &[SmoothParameters] {
        &self.content.definition.smooth
    }
    fn formula(&self) -> Option<&FormulaDefinition> {
        Some(&self.content.definition)
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        let outputs = self.outputs;
        self.value.run(theta, states, self.inputs, contexts, |i, k, value| out[i * outputs + k] = value);
        self.undo(states, contexts, out, None, None);
    }

    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        mut d_theta: Option<&mut [f64]>,
    ) {
        let (outputs, by_state) = (self.outputs, self.outputs * self.inputs);
        let by_theta = outputs * self.parameters.len();
        let tape = if d_theta.is_some() { &self.by_all } else { &self.by_state };
        tape.run(theta, states, self.inputs, contexts, |i, k, value| {
            if k < outputs {
                out[i * outputs + k] = value;
            } else if k < outputs + by_state {
                d_state[i * by_state + k - outputs] = value;
            } else if let Some(d_theta) = d_theta.as_deref_mut() {
                d_theta[i * by_theta + k - outputs - by_state] = value;
            }
        });
        self.undo(states, contexts, out, Some(d_state), d_theta);
    }

    fn linearize_at_nominal(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: &mut [f64],
    ) {
        if self.hook() != HookKind::Depth {
            return self.linearize(theta, states, contexts, out, d_state, Some(d_theta));
        }
        for ((state, out), d) in states.chunks_exact(4).zip(&mut *out).zip(d_state.chunks_exact_mut(4)) {
            *out = state[2];
            d.copy_from_slice(&[0.0, 0.0, 1.0, 0.0]);
        }
        let count = self.parameters.len();
        self.by_theta.run(theta, states, self.inputs, contexts, |i, k, value| d_theta[i * count + k] = value);
        self.undo(states, contexts, out, None, Some(d_theta));
    }
}
