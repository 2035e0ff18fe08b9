//! Derivatives, as nodes of the same graph.

use std::collections::HashMap;

use super::node::{Binary, Graph, Id, Input, Operation, Unary};

impl Graph {
    /// ∂`id`/∂`input`. At a point without a derivative (a step, the corner of an absolute value) it is 0.
    pub fn derivative(&mut self, id: Id, input: Input) -> Id {
        self.derivative_known(id, input, &mut HashMap::new())
    }

    fn derivative_known(&mut self, id: Id, input: Input, known: &mut HashMap<Id, Id>) -> Id {
        if let Some(derivative) = known.get(&id) {
            return *derivative;
        }
        let derivative = match self.operation(id) {
            Operation::Constant(_) => self.constant(0.0),
            Operation::Input(own) => self.constant(f64::from(u8::from(own == input))),
            Operation::Unary(unary, a) => {
                let da = self.derivative_known(a, input, known);
                if self.value(da) == Some(0.0) { da } else { self.of_unary(unary, id, a, da) }
            }
            Operation::Binary(binary, a, b) => {
                let da = self.derivative_known(a, input, known);
                let db = self.derivative_known(b, input, known);
                self.of_binary(binary, id, [a, b], [da, db])
            }
            Operation::Spline { order, t, coefficients } => {
                let by_place = self.derivative_known(t, input, known);
                let slope = self.spline(order.saturating_add(1), t, coefficients);
                let along = self.multiply(slope, by_place);
                let list = self.coefficients(coefficients);
                list.iter().enumerate().fold(along, |sum, (i, coefficient)| {
                    let change = self.derivative_known(*coefficient, input, known);
                    let centre = self.constant(i as f64 - 1.0);
                    let from_centre = self.subtract(t, centre);
                    let basis = self.function(Unary::BSpline(order), from_centre);
                    let term = self.multiply(change, basis);
                    self.add(sum, term)
                })
            }
        };
        known.insert(id, derivative);
        derivative
    }

    fn of_unary(&mut self, unary: Unary, id: Id, a: Id, da: Id) -> Id {
        let one = self.constant(1.0);
        match unary {
            Unary::Negative => self.negative(da),
            Unary::Log => self.divide(da, a),
            Unary::Exp => self.multiply(id, da),
            Unary::Sqrt => {
                let twice = self.add(id, id);
                self.divide_or_zero(da, twice)
            }
            Unary::Sin => {
                let cos = self.function(Unary::Cos, a);
                self.multiply(cos, da)
            }
            Unary::Cos => {
                let sin = self.function(Unary::Sin, a);
                let product = self.multiply(sin, da);
                self.negative(product)
            }
            Unary::Tan => {
                let square = self.multiply(id, id);
                let factor = self.add(one, square);
                self.multiply(factor, da)
            }
            Unary::Atan => {
                let square = self.multiply(a, a);
                let below = self.add(one, square);
                self.divide(da, below)
            }
            Unary::Tanh => {
                let square = self.multiply(id, id);
                let factor = self.subtract(one, square);
                self.multiply(factor, da)
            }
            Unary::Abs => {
                let sign = self.function(Unary::Sign, a);
                self.multiply(sign, da)
            }
            Unary::Step | Unary::Sign => self.constant(0.0),
            Unary::BSpline(order) => {
                let slope = self.function(Unary::BSpline(order.saturating_add(1)), a);
                self.multiply(slope, da)
            }
            Unary::Power(n) => {
                let exponent = self.constant(f64::from(n - 1));
                let lower = self.power(a, exponent);
                let factor = self.constant(f64::from(n));
                let slope = self.multiply(factor, lower);
                self.multiply(slope, da)
            }
        }
    }

    fn of_binary(&mut self, binary: Binary, id: Id, [a, b]: [Id; 2], [da, db]: [Id; 2]) -> Id {
        match binary {
            Binary::Add => self.add(da, db),
            Binary::Subtract => self.subtract(da, db),
            Binary::Multiply => {
                let (left, right) = (self.multiply(da, b), self.multiply(a, db));
                self.add(left, right)
            }
            // (a / b)' = (a' − (a / b) b') / b
            Binary::Divide | Binary::DivideOrZero => {
                let moved = self.multiply(id, db);
                let above = self.subtract(da, moved);
                if binary == Binary::Divide { self.divide(above, b) } else { self.divide_or_zero(above, b) }
            }
            // (aᵇ)' = b aᵇ⁻¹ a' + aᵇ ln a b'
            Binary::Power => {
                let one = self.constant(1.0);
                let exponent = self.subtract(b, one);
                let lower = self.power(a, exponent);
                let slope = self.multiply(b, lower);
                let by_base = self.multiply(slope, da);
                let by_exponent = if self.value(db) == Some(0.0) {
                    db
                } else {
                    let log = self.function(Unary::Log, a);
                    let slope = self.multiply(id, log);
                    self.multiply(slope, db)
                };
                self.add(by_base, by_exponent)
            }
            Binary::Hypot => {
                let (left, right) = (self.multiply(a, da), self.multiply(b, db));
                let above = self.add(left, right);
                self.divide_or_zero(above, id)
            }
        }
    }
}
