//! The nodes of a graph, simplified as they are made.

use std::collections::HashMap;
use std::sync::Arc;

use crate::covariate::FormulaCovariate;

/// A node of a [`Graph`].
pub(crate) type Id = u32;

/// An argument of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Input {
    /// A number of the chain's state at the piece's hook.
    State(u8),
    /// A covariate of the observation that is not part of the state.
    Context(FormulaCovariate),
    /// A parameter.
    Theta(u16),
}

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Unary {
    Negative,
    Log,
    Exp,
    Sqrt,
    Sin,
    Cos,
    Tan,
    Atan,
    Tanh,
    Abs,
    /// 1 above 0, else 0.
    Step,
    /// 1 above 0, −1 below, 0 at 0.
    Sign,
    /// A whole power.
    Power(i32),
    /// The derivative of this order of the cubic B-spline with knots at −2, −1, 0, 1 and 2; the value itself is of order 0.
    BSpline(u8),
}

/// A function of two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    /// The quotient, and 0 where both are 0.
    DivideOrZero,
    Power,
    Hypot,
}

/// The content of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Operation {
    Constant(f64),
    Input(Input),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    /// The derivative of an order of Σ cᵢ β(t + 1 − i), where β is the cubic B-spline and t from 0 to the number of spans.
    Spline {
        order: u8,
        t: Id,
        coefficients: Coefficients,
    },
}

/// Coefficients of a spline, as the number of their list in the [`Graph`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Coefficients(u32);

/// A graph of operations without repetitions. A node's parts come before it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Graph {
    nodes: Vec<Operation>,
    known: HashMap<Key, Id>,
    coefficients: Vec<Arc<[Id]>>,
}

/// An operation, with the bits of constants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Key {
    Constant(u64),
    Input(Input),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    Spline(u8, Id, Coefficients),
}

impl Unary {
    /// Its value.
    #[inline]
    pub fn of(self, a: f64) -> f64 {
        match self {
            Self::Negative => -a,
            Self::Log => a.ln(),
            Self::Exp => a.exp(),
            Self::Sqrt => a.sqrt(),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Atan => a.atan(),
            Self::Tanh => a.tanh(),
            Self::Abs => a.abs(),
            Self::Step => f64::from(u8::from(a > 0.0)),
            Self::Sign => f64::from(i8::from(a > 0.0) - i8::from(a < 0.0)),
            Self::Power(n) => a.powi(n),
            Self::BSpline(order) => b_spline(order, a),
        }
    }
}

/// Coefficients of which a spline is made up at one place.
const SUPPORT: usize = 4;

/// The derivative of an order, up to the third, of the four uniform cubic B-splines that are not zero in a span of length 1, at
/// `u` from its beginning (de Boor, *A Practical Guide to Splines*, 1978).
#[inline]
fn cubic_b_splines(order: u8, u: f64) -> [f64; SUPPORT] {
    let v = 1.0 - u;
    match order {
        0 => [v * v * v, (3.0 * u - 6.0) * u * u + 4.0, (3.0 * v - 6.0) * v * v + 4.0, u * u * u].map(|b| b / 6.0),
        1 => [-v * v, (3.0 * u - 4.0) * u, (4.0 - 3.0 * v) * v, u * u].map(|b| 0.5 * b),
        2 => [v, 3.0 * u - 2.0, 3.0 * v - 2.0, u],
        3 => [-1.0, 3.0, -3.0, 1.0],
        _ => [0.0; SUPPORT],
    }
}

/// The derivative of an order of the cubic B-spline with knots at −2, −1, 0, 1 and 2.
#[inline]
fn b_spline(order: u8, x: f64) -> f64 {
    let span = x.floor();
    // The last of the four begins in the span from −2 to −1, the first ends in that from 1 to 2.
    if (-2.0..2.0).contains(&span) { cubic_b_splines(order, x - span)[(1.0 - span) as usize] } else { 0.0 }
}

/// The derivative of an order, up to the third, of Σ cᵢ β(t + 1 − i) with `count` coefficients, at least four; t is from 0 to
/// `count` − 3. Four of them count.
#[inline]
pub(crate) fn spline(order: u8, t: f64, count: usize, coefficient: impl Fn(usize) -> f64) -> f64 {
    // A negative t and one that is not a number are in the first span.
    let span = (t as usize).min(count - SUPPORT);
    let basis = cubic_b_splines(order, t - span as f64);
    (0..SUPPORT).map(|i| coefficient(span + i) * basis[i]).sum()
}

impl Binary {
    /// Its value.
    #[inline]
    pub fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::DivideOrZero if a == 0.0 && b == 0.0 => 0.0,
            Self::DivideOrZero => a / b,
            Self::Power => a.powf(b),
            Self::Hypot => a.hypot(b),
        }
    }
}

impl Graph {
    /// The content of a node.
    pub fn operation(&self, id: Id) -> Operation {
        self.nodes[id as usize]
    }

    /// The value of a constant node.
    pub fn value(&self, id: Id) -> Option<f64> {
        match self.operation(id) {
            Operation::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// The node of an operation, which is made where there is none yet.
    pub fn intern(&mut self, operation: Operation) -> Id {
        let key = match operation {
            // One zero only.
            Operation::Constant(value) => Key::Constant((value + 0.0).to_bits()),
            Operation::Input(input) => Key::Input(input),
            Operation::Unary(unary, a) => Key::Unary(unary, a),
            Operation::Binary(binary, a, b) => Key::Binary(binary, a, b),
            Operation::Spline { order, t, coefficients } => Key::Spline(order, t, coefficients),
        };
        let nodes = &mut self.nodes;
        *self.known.entry(key).or_insert_with(|| {
            nodes.push(operation);
            nodes.len() as Id - 1
        })
    }

    /// A number.
    pub fn constant(&mut self, value: f64) -> Id {
        self.intern(Operation::Constant(value))
    }

    /// The derivative of an order of a spline, see [`Operation::Spline`]; at least four coefficients.
    pub fn spline(&mut self, order: u8, t: Id, coefficients: Coefficients) -> Id {
        self.intern(Operation::Spline { order, t, coefficients })
    }

    /// A list of coefficients, which has its number from now on.
    pub fn new_coefficients(&mut self, coefficients: &[Id]) -> Coefficients {
        let known = self.coefficients.iter().position(|list| **list == *coefficients);
        Coefficients(known.unwrap_or_else(|| {
            self.coefficients.push(coefficients.into());
            self.coefficients.len() - 1
        }) as u32)
    }

    /// The nodes of a list of coefficients.
    pub fn coefficients(&self, list: Coefficients) -> Arc<[Id]> {
        self.coefficients[list.0 as usize].clone()
    }

    /// A number of the state.
    pub fn state(&mut self, index: u8) -> Id {
        self.intern(Operation::Input(Input::State(index)))
    }

    /// A parameter.
    pub fn theta(&mut self, index: u16) -> Id {
        self.intern(Operation::Input(Input::Theta(index)))
    }

    /// A covariate of the context.
    pub fn of_context(&mut self, covariate: FormulaCovariate) -> Id {
        self.intern(Operation::Input(Input::Context(covariate)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum over all coefficients with the basis function of each.
    #[test]
    fn a_spline_is_the_sum_of_its_basis_functions() {
        let coefficients = [0.3, -1.2, 0.7, 2.1, -0.4, 0.9];
        let count = coefficients.len();
        for order in 0..=3 {
            for step in 1..=30 {
                // Knots, where the third derivative jumps, are between the steps.
                let t = (f64::from(step) * 0.1 - 1e-3).clamp(0.0, 3.0);
                let all: f64 = (0..count).map(|i| coefficients[i] * b_spline(order, t + 1.0 - i as f64)).sum();
                let local = spline(order, t, count, |i| coefficients[i]);
                assert!((all - local).abs() < 1e-13, "order {order} at {t}: {local}, {all} by all");
            }
        }
    }
}
