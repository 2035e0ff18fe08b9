//! Variables over dual numbers, for factors with automatic derivatives.

use nalgebra::{SVector, Unit, Vector3};
use num_dual::DualNum;

use crate::problem::manifold::tangent_basis;
use crate::problem::variable::Variable;

/// A real number or a dual number: the scalar type that a factor's residual is generic over.
pub trait Scalar: DualNum<Primitive = f64> + Copy + Send + Sync {}

impl<T: DualNum<Primitive = f64> + Copy + Send + Sync> Scalar for T {}

/// A variable of static dimension that [factors](crate::Factor) with automatic derivatives can use.
pub trait AutoDiffVariable: Variable {
    /// Dimension of the tangent space.
    const DIM: usize;

    /// The variable with components of the scalar type `T`.
    type Over<T: Scalar>;

    /// `self.retract(δ)` over the scalar type `T`; `delta(i)` is δᵢ for i in 0..[`DIM`](Self::DIM). Only the value and the
    /// first derivatives at δ = 0 are used, so an expression that is correct to first order in δ is enough.
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Self::Over<T>;
}

/// The numbers as an array, if there are N.
#[inline(always)]
fn exactly<T: Copy, const N: usize>(numbers: &[T]) -> Option<[T; N]> {
    numbers.first_chunk().copied()
}

impl<const N: usize> AutoDiffVariable for SVector<f64, N> {
    const DIM: usize = N;
    type Over<T: Scalar> = SVector<T, N>;

    #[inline(always)]
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> SVector<T, N> {
        let component = |i: usize| delta(i) + self[i];
        // An array that is filled in a loop would stay in memory, and with it what has no derivative.
        let few: Option<[T; N]> = match N {
            1 => exactly(&[component(0)]),
            2 => exactly(&[component(0), component(1)]),
            3 => exactly(&[component(0), component(1), component(2)]),
            4 => exactly(&[component(0), component(1), component(2), component(3)]),
            5 => exactly(&[component(0), component(1), component(2), component(3), component(4)]),
            6 => exactly(&[component(0), component(1), component(2), component(3), component(4), component(5)]),
            _ => None,
        };
        SVector::from(few.unwrap_or_else(|| std::array::from_fn(component)))
    }
}

impl AutoDiffVariable for Unit<Vector3<f64>> {
    const DIM: usize = 2;
    type Over<T: Scalar> = Vector3<T>;

    #[inline(always)]
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> Vector3<T> {
        let [b0, b1] = tangent_basis(self);
        let component = |i: usize| delta(0) * b0[i] + delta(1) * b1[i] + self[i];
        Vector3::new(component(0), component(1), component(2))
    }
}
