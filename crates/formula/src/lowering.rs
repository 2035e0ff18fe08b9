//! From an expression to a graph: names become inputs and numbers.

use depthcal_model::hook::HookKind;

use crate::covariate::FormulaCovariate;
use crate::graph::{Graph, Id, Unary};
use crate::syntax::{Expression, Function, Node, Operator, SPLINE_RANGE};

/// The meaning of a name in a formula.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Meaning {
    Covariate(FormulaCovariate),
    /// A parameter, by its place.
    Parameter(u16),
    Constant(f64),
    /// A number of the state, whatever the hook.
    State(u8),
}

/// The node of an expression of a piece at `hook`.
pub(crate) fn lower(
    graph: &mut Graph,
    hook: HookKind,
    expression: &Expression,
    meaning: &impl Fn(&str) -> Meaning,
) -> Id {
    let mut lowered = |part: &Expression| lower(graph, hook, part, meaning);
    match &expression.node {
        Node::Number(value) => graph.constant(*value),
        Node::Name(name) => match meaning(name) {
            Meaning::Covariate(covariate) => covariate_node(graph, hook, covariate),
            Meaning::Parameter(index) => graph.theta(index),
            Meaning::State(index) => graph.state(index),
            Meaning::Constant(value) => graph.constant(value),
        },
        Node::Negative(part) => {
            let part = lowered(part);
            graph.negative(part)
        }
        Node::Binary(operator, a, b) => {
            let (a, b) = (lowered(a), lowered(b));
            match operator {
                Operator::Add => graph.add(a, b),
                Operator::Subtract => graph.subtract(a, b),
                Operator::Multiply => graph.multiply(a, b),
                Operator::Divide => graph.divide(a, b),
                Operator::Power => graph.power(a, b),
            }
        }
        Node::Call(function, parts) => {
            let parts: Vec<Id> = parts.iter().map(lowered).collect();
            call(graph, *function, &parts)
        }
    }
}

fn call(graph: &mut Graph, function: Function, parts: &[Id]) -> Id {
    let a = parts[0];
    match function {
        Function::Log => graph.function(Unary::Log, a),
        Function::Exp => graph.function(Unary::Exp, a),
        Function::Sqrt => graph.sqrt(a),
        Function::Sin => graph.function(Unary::Sin, a),
        Function::Cos => graph.function(Unary::Cos, a),
        Function::Tan => graph.function(Unary::Tan, a),
        Function::Atan => graph.function(Unary::Atan, a),
        Function::Tanh => graph.function(Unary::Tanh, a),
        Function::Abs => graph.function(Unary::Abs, a),
        Function::Step => graph.function(Unary::Step, a),
        Function::Hinge => hinge(graph, a),
        Function::Max => larger(graph, a, parts[1]),
        Function::Min => smaller(graph, a, parts[1]),
        Function::Spline => spline(graph, [a, parts[1], parts[2]], &parts[SPLINE_RANGE..]),
    }
}

/// max(a, b) = a + hinge(b − a)
fn larger(graph: &mut Graph, a: Id, b: Id) -> Id {
    let above = graph.subtract(b, a);
    let more = hinge(graph, above);
    graph.add(a, more)
}

/// min(a, b) = a − hinge(a − b)
fn smaller(graph: &mut Graph, a: Id, b: Id) -> Id {
    let above = graph.subtract(a, b);
    let more = hinge(graph, above);
    graph.subtract(a, more)
}

/// Σ cᵢ β(t + 1 − i) with the uniform cubic B-spline β, where t goes from 0 to the number of spans as x does from `low` to
/// `high`.
fn spline(graph: &mut Graph, [x, low, high]: [Id; 3], coefficients: &[Id]) -> Id {
    let zero = graph.constant(0.0);
    let spans = graph.constant(coefficients.len() as f64 - 3.0);
    let (above, range) = (graph.subtract(x, low), graph.subtract(high, low));
    let share = graph.divide(above, range);
    let t = graph.multiply(share, spans);
    let t = larger(graph, t, zero);
    let t = smaller(graph, t, spans);
    let coefficients = graph.new_coefficients(coefficients);
    graph.spline(0, t, coefficients)
}

fn hinge(graph: &mut Graph, a: Id) -> Id {
    let on = graph.function(Unary::Step, a);
    graph.multiply(on, a)
}

/// A covariate as a function of the inputs of a piece at `hook`.
fn covariate_node(graph: &mut Graph, hook: HookKind, covariate: FormulaCovariate) -> Id {
    use FormulaCovariate as C;
    let [first, second] = [0, 1].map(|i| graph.state(i));
    let one = graph.constant(1.0);
    match covariate {
        C::X | C::BoardX => first,
        C::Y | C::BoardY => second,
        C::U if hook == HookKind::Pixel => first,
        C::V if hook == HookKind::Pixel => second,
        C::R => graph.hypot(first, second),
        C::Rho => graph.state(2),
        C::Z => {
            let rho = graph.state(2);
            graph.divide(one, rho)
        }
        C::Range => {
            let radius = graph.hypot(first, second);
            let slant = graph.hypot(radius, one);
            let rho = graph.state(2);
            graph.divide(slant, rho)
        }
        C::Incidence => {
            let cosine = graph.state(3);
            let slant = graph.divide(one, cosine);
            graph.subtract(slant, one)
        }
        C::U | C::V | C::Amplitude | C::Surroundings | C::Time | C::Temperature | C::Quantity(_) => {
            graph.of_context(covariate)
        }
    }
}

/// The outputs of a piece at `hook`, given the formulas' values and what they are added to.
pub(crate) fn outputs(graph: &mut Graph, hook: HookKind, adds_to: depthcal_model::AddsTo, values: &[Id]) -> Vec<Id> {
    use depthcal_model::AddsTo as To;
    let one = graph.constant(1.0);
    let e = values[0];
    match (hook, adds_to) {
        (HookKind::Depth, To::InverseDepth) => {
            let rho = graph.state(2);
            vec![graph.add(rho, e)]
        }
        // z_m = z + e: ρ_m = ρ / (1 + e ρ)
        (HookKind::Depth, To::Depth) => {
            let rho = graph.state(2);
            let share = graph.multiply(e, rho);
            let below = graph.add(one, share);
            vec![graph.divide(rho, below)]
        }
        // z_m = z (1 + e): ρ_m = ρ / (1 + e)
        (HookKind::Depth, _) => {
            let rho = graph.state(2);
            let below = graph.add(one, e);
            vec![graph.divide(rho, below)]
        }
        (HookKind::Lens, To::Factor) => {
            let factor = graph.add(one, e);
            [3, 4]
                .map(|i| {
                    let coordinate = graph.state(i);
                    graph.multiply(coordinate, factor)
                })
                .to_vec()
        }
        _ => {
            // Coordinates as they are, with the values added to some of them.
            let (places, count): ([u8; 3], usize) = match hook {
                HookKind::Lens => ([3, 4, 4], 2),
                HookKind::Pixel => ([0, 1, 1], 2),
                _ => ([0, 1, 2], 3),
            };
            let first = match adds_to {
                To::Y | To::V => 1,
                To::Z => 2,
                _ => 0,
            };
            (0..count)
                .map(|i| {
                    let coordinate = graph.state(places[i]);
                    match i.checked_sub(first).and_then(|k| values.get(k)) {
                        Some(value) => graph.add(coordinate, *value),
                        None => coordinate,
                    }
                })
                .collect()
        }
    }
}
