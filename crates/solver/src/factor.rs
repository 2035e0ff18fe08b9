//! Factors with automatic derivatives.

use std::fmt::Debug;

use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};

use crate::lift::{Lift, Scalar};
use crate::values::{Key, Values, VariableId};

/// A residual of static dimension M over a tuple of one to six variables.
///
/// One generic function makes a factor; its Jacobian follows by forward differentiation, four directions at a time.
/// Write the function without branches on derivatives, and mind that √0 has none. Marked `#[inline(always)]` it is compiled
/// for the vector instructions of the machine it runs on.
///
/// ```
/// use depthcal_solver::{Factor, Graph, Lifted, Options, Scalar, Values, minimize};
/// use nalgebra::{Isometry3, SVector, Vector2, Vector3};
///
/// /// A point seen by a camera of unit focal length.
/// struct Projection {
///     observed: Vector2<f64>,
/// }
///
/// impl Factor<2> for Projection {
///     type Variables = (Isometry3<f64>, Vector3<f64>);
///
///     fn residual<T: Scalar>(&self, (pose, point): Lifted<Self::Variables, T>) -> SVector<T, 2> {
///         let x = pose.transform(&point);
///         SVector::<T, 2>::new(x[0] / x[2] - self.observed.x, x[1] / x[2] - self.observed.y)
///     }
/// }
///
/// let mut values = Values::new();
/// let pose = values.insert(Isometry3::identity());
/// let point = values.insert(Vector3::new(0.0, 0.0, 2.0));
/// let mut graph = Graph::new();
/// graph.add(Projection { observed: Vector2::new(0.1, 0.2) }, (pose, point));
/// graph.fix(pose);
/// let solution = minimize(&graph, values, &Options::default())?;
/// let point = solution.values.get(point);
/// assert!((point.x / point.z - 0.1).abs() < 1e-9);
/// # Ok::<(), depthcal_solver::SolveError>(())
/// ```
///
/// A key of the wrong type does not compile:
///
/// ```compile_fail
/// # use depthcal_solver::{Factor, Graph, Lifted, Scalar, Values};
/// # use nalgebra::{Isometry3, SVector, Vector3};
/// # struct Height;
/// # impl Factor<1> for Height {
/// #     type Variables = (Isometry3<f64>,);
/// #     fn residual<T: Scalar>(&self, (pose,): Lifted<Self::Variables, T>) -> SVector<T, 1> {
/// #         SVector::<T, 1>::new(pose.translation[2])
/// #     }
/// # }
/// let mut values = Values::new();
/// let point = values.insert(Vector3::new(0.0, 0.0, 2.0));
/// // `Height` is about a pose, not about a point.
/// Graph::new().add(Height, (point,));
/// ```
pub trait Factor<const M: usize>: Send + Sync + 'static {
    /// The variables, a tuple such as `(Isometry3<f64>, Vector3<f64>)`.
    type Variables: VariableTuple;

    /// The residual, observed from predicted or the reverse, before whitening by the batch's noise.
    fn residual<T: Scalar>(&self, variables: Lifted<Self::Variables, T>) -> SVector<T, M>;

    /// The residual and, row-major M × Σ dim, its Jacobian with respect to the tangent vectors of the variables at 0.
    ///
    /// The default differentiates [`residual`](Self::residual). Override it where derivatives by hand are faster, and
    /// check them with [`check_jacobians`](crate::check_jacobians).
    #[inline(always)]
    fn linearize(&self, variables: &Borrowed<'_, Self::Variables>, jacobian: &mut [f64]) -> SVector<f64, M> {
        differentiate(self, variables, jacobian)
    }
}

/// The variables of a factor over the scalar `T`.
pub type Lifted<V, T> = <V as VariableTuple>::Lifted<T>;

/// References to the variables of a factor.
pub type Borrowed<'a, V> = <V as VariableTuple>::Borrowed<'a>;

/// A tuple of one to six variables of static dimension.
pub trait VariableTuple: 'static {
    /// A typed key for each variable.
    type Keys: Copy + PartialEq + Send + Sync + Debug + 'static;
    /// A reference to each variable.
    type Borrowed<'a>;
    /// Each variable over the scalar `T`.
    type Lifted<T: Scalar>;
    /// Σ tangent dimensions.
    const DIM: usize;
    /// Number of variables.
    const COUNT: usize;

    /// Appends the ids of the variables.
    fn ids(keys: &Self::Keys, ids: &mut Vec<VariableId>);
    /// The variables' values, if all keys belong to `values`.
    fn borrow<'a>(keys: &Self::Keys, values: &'a Values) -> Option<Self::Borrowed<'a>>;
    /// The variables moved by the stacked tangent vector δ, to first order.
    fn lift<T: Scalar>(variables: &Self::Borrowed<'_>, delta: impl Fn(usize) -> T) -> Self::Lifted<T>;
}

macro_rules! variable_tuple {
    ($count:literal; $($variable:ident $index:tt),+) => {
        impl<$($variable: Lift),+> VariableTuple for ($($variable,)+) {
            type Keys = ($(Key<$variable>,)+);
            type Borrowed<'a> = ($(&'a $variable,)+);
            type Lifted<T: Scalar> = ($($variable::Lifted<T>,)+);
            const DIM: usize = 0 $(+ $variable::DIM)+;
            const COUNT: usize = $count;

            fn ids(keys: &Self::Keys, ids: &mut Vec<VariableId>) {
                ids.extend([$(keys.$index.id()),+]);
            }

            #[inline(always)]
            fn borrow<'a>(keys: &Self::Keys, values: &'a Values) -> Option<Self::Borrowed<'a>> {
                Some(($(values.try_get(keys.$index)?,)+))
            }

            #[inline(always)]
            fn lift<T: Scalar>(variables: &Self::Borrowed<'_>, delta: impl Fn(usize) -> T) -> Self::Lifted<T> {
                let mut next = 0;
                ($({
                    let offset = next;
                    next += $variable::DIM;
                    let _ = next;
                    variables.$index.lift(|i| delta(offset + i))
                },)+)
            }
        }
    };
}

variable_tuple!(1; A 0);
variable_tuple!(2; A 0, B 1);
variable_tuple!(3; A 0, B 1, C 2);
variable_tuple!(4; A 0, B 1, C 2, D 3);
variable_tuple!(5; A 0, B 1, C 2, D 3, E 4);
variable_tuple!(6; A 0, B 1, C 2, D 3, E 4, F 5);

/// The residual's value.
#[inline(always)]
pub(crate) fn value<F: Factor<M> + ?Sized, const M: usize>(
    factor: &F,
    variables: &Borrowed<'_, F::Variables>,
) -> SVector<f64, M> {
    factor.residual(<F::Variables as VariableTuple>::lift(variables, |_| 0.0))
}

/// Width of the dual numbers. Four derivatives fit the vector registers; one wide dual number is many times slower.
const WIDTH: usize = 4;

#[inline(always)]
fn differentiate<F: Factor<M> + ?Sized, const M: usize>(
    factor: &F,
    variables: &Borrowed<'_, F::Variables>,
    jacobian: &mut [f64],
) -> SVector<f64, M> {
    let dim = <F::Variables as VariableTuple>::DIM;
    let mut residual = SVector::zeros();
    for first in (0..dim).step_by(WIDTH) {
        let lifted = <F::Variables as VariableTuple>::lift(variables, |i| seed(i.wrapping_sub(first)));
        let dual: SVector<DualSVec64<WIDTH>, M> = factor.residual(lifted);
        let used = WIDTH.min(dim - first);
        for m in 0..M {
            residual[m] = dual[m].re;
            let row = &mut jacobian[m * dim + first..][..used];
            match &dual[m].eps.0 {
                Some(eps) => row.copy_from_slice(&eps.as_slice()[..used]),
                None => row.fill(0.0),
            }
        }
    }
    residual
}

/// Zero, with a unit derivative in direction `i` if there is such a direction.
#[inline(always)]
fn seed(i: usize) -> DualSVec64<WIDTH> {
    if i < WIDTH {
        let mut eps = SVector::<f64, WIDTH>::zeros();
        eps[i] = 1.0;
        DualSVec64::new(0.0, Derivative::some(eps))
    } else {
        DualSVec64::from(0.0)
    }
}
