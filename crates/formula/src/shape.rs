//! Values of a formula at typical observations, for its checks.

use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, Context, MOST_QUANTITIES, Options, Quantities};

use crate::content::Content;
use crate::covariate::FormulaCovariate;
use crate::error::FormulaError;
use crate::graph::{Graph, Input, Tape};
use crate::lowering::lower;

/// A parameter without influence on the formula at typical observations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Uninfluential;

/// The bare value of a formula, before it is added to anything, with its derivatives by the parameters.
struct Shape<'a> {
    content: &'a Content,
    /// One value for each expression, then the derivatives of the first by each parameter, of the second, ….
    tape: Tape,
    parameters: usize,
}

/// Typical observations: states of the widest hook, and contexts.
struct Observations {
    states: Vec<f64>,
    inputs: usize,
    contexts: Vec<Context>,
}

/// Number of typical observations.
const COUNT: usize = 256;
/// Bases of Halton's sequence for quantities.
const MORE_BASES: [usize; MOST_QUANTITIES] = [23, 29, 31, 37, 41, 43];

impl<'a> Shape<'a> {
    fn new(content: &'a Content) -> Self {
        let mut graph = Graph::default();
        let meaning = content.meaning(&Options::new());
        let mut outputs: Vec<_> =
            content.expressions.iter().map(|e| lower(&mut graph, content.hook(), e, &meaning)).collect();
        let parameters = content.definition.parameters.len();
        for value in outputs.clone() {
            outputs.extend((0..parameters).map(|i| graph.derivative(value, Input::Theta(i as u16))));
        }
        Self { content, tape: Tape::new(&graph, &outputs), parameters }
    }

    /// The first typical observation where a value or a derivative is not finite, in words.
    fn place_without_value(&self, theta: &[f64]) -> Option<String> {
        let observations = Observations::typical(self.content);
        let mut first = None;
        self.run(theta, &observations, |i, _, value| {
            if !value.is_finite() {
                first = Some(first.map_or(i, |first: usize| first.min(i)));
            }
        });
        first.map(|i| self.words(&observations, i))
    }

    /// The largest value over typical observations, and where.
    fn largest_at(&self, theta: &[f64]) -> Option<(f64, String)> {
        let observations = Observations::typical(self.content);
        let mut largest: Option<(f64, usize)> = None;
        self.run(theta, &observations, |i, k, value| {
            if k < self.content.expressions.len() && largest.is_none_or(|(v, _)| value.abs() > v.abs()) {
                largest = Some((value, i));
            }
        });
        largest.map(|(value, i)| (value, self.words(&observations, i)))
    }

    /// The deviation of every parameter that makes an effect of about a millimetre at a metre, or half a pixel.
    fn scales(&self, theta: &[f64]) -> Vec<Result<f64, Uninfluential>> {
        let observations = Observations::typical(self.content);
        let mut squares = vec![0.0; self.parameters];
        self.run(theta, &observations, |_, k, value| {
            if let Some(k) = k.checked_sub(self.content.expressions.len()) {
                squares[k % self.parameters] += value * value;
            }
        });
        let wanted = match (self.content.hook(), self.content.adds_to) {
            (_, AddsTo::InverseDepth) => 1e-6,
            (HookKind::Depth, AddsTo::Depth) => 1.0,
            (HookKind::Pixel, _) => 0.5,
            (HookKind::Board, _) => 0.3,
            _ => 1e-3,
        };
        let scale = |sum: f64| {
            let rms = (sum / COUNT as f64).sqrt();
            if rms > 0.0 && (wanted / rms).is_finite() { Ok(rounded(wanted / rms)) } else { Err(Uninfluential) }
        };
        squares.into_iter().map(scale).collect()
    }

    fn run(&self, theta: &[f64], observations: &Observations, store: impl FnMut(usize, usize, f64)) {
        self.tape.run(theta, &observations.states, observations.inputs, &observations.contexts, store);
    }

    /// The covariates of an observation in words.
    fn words(&self, observations: &Observations, i: usize) -> String {
        let state = &observations.states[i * observations.inputs..];
        let value = |covariate: FormulaCovariate| covariate.value(state, &observations.contexts[i]);
        let words: Vec<String> = self
            .content
            .covariates
            .iter()
            .map(|covariate| format!("{} = {}", covariate.name(), rounded(value(*covariate))))
            .collect();
        if words.is_empty() { "everywhere".to_owned() } else { words.join(", ") }
    }
}

/// Checks the values of a formula, and finds the typical deviations of its parameters.
pub(crate) fn checked_scales(content: &Content) -> Result<Vec<f64>, FormulaError> {
    let field = |field: String, problem: String| FormulaError::Field {
        effect: content.definition.name.clone(),
        field,
        problem,
    };
    let nominal = content.nominal();
    let shape = Shape::new(content);
    if let Some(place) = shape.place_without_value(&nominal) {
        let remedy = "keep arguments of log and sqrt positive and divisors away from 0 over the whole range, \
                      with hinge(…), abs(…) or a constant";
        return Err(field("formula".to_owned(), format!("has no finite value at {place}; {remedy}")));
    }
    if let Some((value, place)) = shape.largest_at(&nominal).filter(|(value, _)| value.abs() > 0.0) {
        let problem = format!(
            "is {value:.3e} at the parameters' nominal values ({place}), where it has to be zero: \
             multiply what remains by a parameter, or set a parameter's nominal"
        );
        return Err(field("formula".to_owned(), problem));
    }
    let scales = shape.scales(&nominal);
    let parameters = content.definition.parameters.iter().zip(scales);
    parameters
        .map(|((name, parameter), scale)| match (parameter.table().scale, scale) {
            (Some(scale), _) if scale > 0.0 && scale.is_finite() => Ok(scale),
            (Some(_), _) => Err(field(format!("parameters.{name}.scale"), "has to be above 0".to_owned())),
            (None, Ok(scale)) => Ok(scale),
            (None, Err(Uninfluential)) => Err(field(
                format!("parameters.{name}"),
                format!(
                    "changes nothing while the other parameters have their nominal values: make it a constant, \
                     {name} = {{ value = …, search = \"period\" }}, or give it a nominal and a scale"
                ),
            )),
        })
        .collect()
}

/// Three significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

impl Observations {
    /// Observations that fill the usual ranges of all covariates evenly: images of 640×480, fields of view of 70°, depths of 0.4
    /// m to 4 m, boards of 0.4 m.
    fn typical(content: &Content) -> Self {
        let hook = content.hook();
        let quantities = content.covariates.iter().filter_map(|covariate| match covariate {
            FormulaCovariate::Quantity(quantity) => Some(*quantity),
            _ => None,
        });
        // Halton's sequence: points that fill a space of several dimensions evenly.
        let halton = |index: usize, base: usize| {
            let (mut value, mut share, mut remaining) = (0.0, 1.0, index);
            while remaining > 0 {
                share /= base as f64;
                value += share * (remaining % base) as f64;
                remaining /= base;
            }
            value
        };
        let inputs = match hook {
            HookKind::Lens => 5,
            HookKind::Depth => 4,
            HookKind::Pixel => 2,
            HookKind::Board | HookKind::Pose => 3,
        };
        let (mut states, mut contexts) = (Vec::new(), Vec::new());
        for i in 1..=COUNT {
            let sampled = |base: usize, low: f64, high: f64| low + (high - low) * halton(i, base);
            let (u, v) = (sampled(2, 0.0, 639.0), sampled(3, 0.0, 479.0));
            let (x, y) = ((u - 319.5) / 500.0, (v - 239.5) / 500.0);
            let rho = sampled(5, 1.0 / 4000.0, 1.0 / 400.0);
            states.extend(match hook {
                HookKind::Lens => vec![x, y, rho, x, y],
                HookKind::Depth => vec![x, y, rho, sampled(7, 0.5, 1.0)],
                HookKind::Pixel => vec![u, v],
                HookKind::Board | HookKind::Pose => vec![sampled(2, 0.0, 400.0), sampled(3, 0.0, 300.0), 0.0],
            });
            let amplitude = (sampled(11, 50_f64.ln(), 5000_f64.ln())).exp();
            contexts.push(Context {
                pixel: [u, v],
                amplitude,
                surround: amplitude * sampled(13, 0.7, 1.4),
                time_s: sampled(17, 0.0, 2000.0),
                temperature_c: sampled(19, 15.0, 45.0),
                quantities: Quantities::new(quantities.clone().zip(MORE_BASES).map(|(quantity, base)| {
                    let [low, high] = quantity.typical_range();
                    (quantity, sampled(base, low, high))
                })),
                ..Context::default()
            });
        }
        Self { states, inputs, contexts }
    }
}
