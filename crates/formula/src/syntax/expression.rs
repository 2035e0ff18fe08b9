//! The expression of a formula, as it was written.

use std::ops::{Range, RangeInclusive};

/// A part of a formula with its place in the text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Expression {
    pub node: Node,
    /// Bytes of the text.
    pub span: Range<usize>,
}

/// The content of an expression.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Node {
    Number(f64),
    /// A covariate, a parameter or a constant.
    Name(String),
    Negative(Box<Expression>),
    Binary(Operator, Box<Expression>, Box<Expression>),
    Call(Function, Vec<Expression>),
}

/// An operation of two parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

/// A function that formulas may call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Function {
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
    /// The argument above 0, else 0.
    Hinge,
    Min,
    Max,
    /// A cubic spline of its first argument, from the second to the third, with the others as coefficients; constant beyond.
    Spline,
}

/// Arguments of a spline before its coefficients.
pub(crate) const SPLINE_RANGE: usize = 3;

impl Function {
    /// All functions with their names.
    pub const NAMES: [(&'static str, Self); 15] = [
        ("log", Self::Log),
        ("ln", Self::Log),
        ("exp", Self::Exp),
        ("sqrt", Self::Sqrt),
        ("sin", Self::Sin),
        ("cos", Self::Cos),
        ("tan", Self::Tan),
        ("atan", Self::Atan),
        ("tanh", Self::Tanh),
        ("abs", Self::Abs),
        ("step", Self::Step),
        ("hinge", Self::Hinge),
        ("min", Self::Min),
        ("max", Self::Max),
        ("spline", Self::Spline),
    ];

    /// The function of that name.
    pub fn of(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(n, _)| *n == name).map(|(_, function)| *function)
    }

    /// Its name in formulas.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, function)| *function == self).map_or("", |(name, _)| name)
    }

    /// Fewest and most arguments.
    pub fn arguments(self) -> RangeInclusive<usize> {
        match self {
            Self::Min | Self::Max => 2..=2,
            Self::Spline => SPLINE_RANGE + 4..=SPLINE_RANGE + 64,
            _ => 1..=1,
        }
    }
}

impl Expression {
    /// All names in it, in the order of the text, with repetitions.
    pub fn names(&self) -> Vec<(&str, Range<usize>)> {
        match &self.node {
            Node::Number(_) => Vec::new(),
            Node::Name(name) => vec![(name, self.span.clone())],
            Node::Negative(part) => part.names(),
            Node::Binary(_, a, b) => [a.names(), b.names()].concat(),
            Node::Call(_, parts) => parts.iter().flat_map(Self::names).collect(),
        }
    }
}
