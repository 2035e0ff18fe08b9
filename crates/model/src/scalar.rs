//! The number type of all measurement equations.

use num_dual::DualNum;

/// A real number or a dual number. Every equation of this crate is written over any of them, so that one function gives the
/// value and, by forward differentiation, its exact derivatives.
///
/// Products and sums with plain numbers have these on the right: `x * 2.0`.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}

impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}
