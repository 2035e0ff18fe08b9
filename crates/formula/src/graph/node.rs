//! The nodes of a graph, simplified as they are made.

use std::collections::HashMap;

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
}

/// A graph of operations without repetitions. A node's parts come before it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Graph {
    nodes: Vec<Operation>,
    known: HashMap<Key, Id>,
}

/// An operation, with the bits of constants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Key {
    Constant(u64),
    Input(Input),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
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

/// The derivative of an order, up to the third, of the cubic B-spline with knots at −2, −1, 0, 1 and 2 (de Boor, *A Practical
/// Guide to Splines*, 1978).
#[inline]
fn b_spline(order: u8, x: f64) -> f64 {
    // β(x) = ((2 − |x|)₊³ − 4 (1 − |x|)₊³) / 6, without branches.
    let u = x.abs();
    let (outer, inner) = ((2.0 - u).max(0.0), (1.0 - u).max(0.0));
    let sign = x.signum();
    match order {
        0 => (outer * outer * outer - 4.0 * inner * inner * inner) / 6.0,
        1 => sign * (2.0 * inner * inner - 0.5 * outer * outer),
        2 => outer - 4.0 * inner,
        3 => sign * (4.0 * f64::from(u8::from(u < 1.0)) - f64::from(u8::from(u < 2.0))),
        _ => 0.0,
    }
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
