//! Operations on nodes, simplified: constants are computed, and sums with 0 and products with 0 and 1 vanish.

use super::node::{Binary, Graph, Id, Operation, Unary};

impl Graph {
    fn is(&self, id: Id, value: f64) -> bool {
        self.value(id) == Some(value)
    }

    fn unary(&mut self, unary: Unary, a: Id) -> Id {
        match self.value(a) {
            Some(value) => self.constant(unary.of(value)),
            None => self.intern(Operation::Unary(unary, a)),
        }
    }

    fn binary(&mut self, binary: Binary, a: Id, b: Id) -> Id {
        match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => self.constant(binary.of(x, y)),
            _ => self.intern(Operation::Binary(binary, a, b)),
        }
    }

    /// −a.
    pub fn negative(&mut self, a: Id) -> Id {
        match self.operation(a) {
            Operation::Unary(Unary::Negative, inner) => inner,
            _ => self.unary(Unary::Negative, a),
        }
    }

    /// a + b.
    pub fn add(&mut self, a: Id, b: Id) -> Id {
        match () {
            () if self.is(a, 0.0) => b,
            () if self.is(b, 0.0) => a,
            // The order of a sum's parts does not matter; one order makes equal sums one node.
            () => self.binary(Binary::Add, a.min(b), a.max(b)),
        }
    }

    /// a − b.
    pub fn subtract(&mut self, a: Id, b: Id) -> Id {
        match () {
            () if self.is(b, 0.0) => a,
            () if self.is(a, 0.0) => self.negative(b),
            () if a == b => self.constant(0.0),
            () => self.binary(Binary::Subtract, a, b),
        }
    }

    /// a b. A product with 0 is 0, although the other part may be infinite: derivatives are then those of the rest.
    pub fn multiply(&mut self, a: Id, b: Id) -> Id {
        match () {
            () if self.is(a, 0.0) || self.is(b, 0.0) => self.constant(0.0),
            () if self.is(a, 1.0) => b,
            () if self.is(b, 1.0) => a,
            () if self.is(a, -1.0) => self.negative(b),
            () if self.is(b, -1.0) => self.negative(a),
            () => self.binary(Binary::Multiply, a.min(b), a.max(b)),
        }
    }

    /// a / b.
    pub fn divide(&mut self, a: Id, b: Id) -> Id {
        match () {
            () if self.is(a, 0.0) => a,
            () if self.is(b, 1.0) => a,
            () => self.binary(Binary::Divide, a, b),
        }
    }

    /// a / b, and 0 where both are 0.
    pub fn divide_or_zero(&mut self, a: Id, b: Id) -> Id {
        if self.is(a, 0.0) { a } else { self.binary(Binary::DivideOrZero, a, b) }
    }

    /// √(a² + b²).
    pub fn hypot(&mut self, a: Id, b: Id) -> Id {
        self.binary(Binary::Hypot, a, b)
    }

    /// a to the power of b.
    pub fn power(&mut self, a: Id, b: Id) -> Id {
        match self.value(b) {
            Some(1.0) => a,
            Some(0.0) => self.constant(1.0),
            Some(2.0) => self.multiply(a, a),
            Some(0.5) => self.sqrt(a),
            Some(n) if n.fract() == 0.0 && n.abs() <= 64.0 => self.unary(Unary::Power(n as i32), a),
            _ => self.binary(Binary::Power, a, b),
        }
    }

    /// √a.
    pub fn sqrt(&mut self, a: Id) -> Id {
        self.unary(Unary::Sqrt, a)
    }

    /// A function of one number.
    pub fn function(&mut self, unary: Unary, a: Id) -> Id {
        self.unary(unary, a)
    }
}
