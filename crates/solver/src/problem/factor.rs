//! Factors with automatic derivatives.

use std::fmt::Debug;

use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};

use crate::problem::autodiff::{AutoDiffVariable, Scalar};
use crate::problem::key::{Key, VariableId};
use crate::problem::values::Values;

/// A residual of static dimension M over a tuple of one to six variables.
///
/// A factor is one generic function, [`residual`](Self::residual); its Jacobian follows by forward differentiation with dual
/// numbers, four directions at a time. Do not branch on derivatives in it, and note that √0 has none. With
/// `#[inline(always)]` it is compiled for the vector instructions of the machine that it runs on.
///
/// ```
/// use depthcal_solver::{Factor, Graph, Options, Over, Scalar, Values, minimize};
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
///     fn residual<T: Scalar>(&self, (pose, point): Over<Self::Variables, T>) -> SVector<T, 2> {
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
/// # use depthcal_solver::{Factor, Graph, Over, Scalar, Values};
/// # use nalgebra::{Isometry3, SVector, Vector3};
/// # struct Height;
/// # impl Factor<1> for Height {
/// #     type Variables = (Isometry3<f64>,);
/// #     fn residual<T: Scalar>(&self, (pose,): Over<Self::Variables, T>) -> SVector<T, 1> {
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

    /// The residual, predicted − observed or the reverse, before whitening by the batch's noise model.
    fn residual<T: Scalar>(&self, variables: Over<Self::Variables, T>) -> SVector<T, M>;

    /// Returns the residual and writes its Jacobian with respect to the tangent vectors of the variables at 0: `jacobian` is
    /// row-major, M × [`DIM`](VariableTuple::DIM), with the variables' columns in the order of the tuple.
    ///
    /// The default differentiates [`residual`](Self::residual). Override it where hand-written derivatives are faster, and
    /// check them with [`check_jacobians`](crate::check_jacobians).
    #[inline(always)]
    fn linearize(&self, variables: &Borrowed<'_, Self::Variables>, jacobian: &mut [f64]) -> SVector<f64, M> {
        differentiate(self, variables, jacobian)
    }
}

/// The variables `V` of a factor with components of the scalar type `T`.
pub type Over<V, T> = <V as VariableTuple>::Over<T>;

/// References to the variables of a factor.
pub type Borrowed<'a, V> = <V as VariableTuple>::Borrowed<'a>;

/// A tuple of one to six variables of static dimension.
pub trait VariableTuple: 'static {
    /// A typed key for each variable.
    type Keys: Copy + PartialEq + Send + Sync + Debug + 'static;
    /// A reference to each variable.
    type Borrowed<'a>;
    /// Each variable with components of the scalar type `T`.
    type Over<T: Scalar>;
    /// Sum of the variables' tangent dimensions.
    const DIM: usize;
    /// Number of variables.
    const COUNT: usize;

    /// Appends the ids of the variables.
    fn ids(keys: &Self::Keys, ids: &mut Vec<VariableId>);
    /// References to the variables' values; `None` unless all keys belong to `values`.
    fn borrow<'a>(keys: &Self::Keys, values: &'a Values) -> Option<Self::Borrowed<'a>>;
    /// The variables retracted by the stacked tangent vector δ, to first order; `delta(i)` is δᵢ for i in
    /// 0..[`DIM`](Self::DIM).
    fn retract_over<T: Scalar>(variables: &Self::Borrowed<'_>, delta: impl Fn(usize) -> T) -> Self::Over<T>;
}

macro_rules! variable_tuple {
    ($count:literal; $($variable:ident $index:tt),+) => {
        impl<$($variable: AutoDiffVariable),+> VariableTuple for ($($variable,)+) {
            type Keys = ($(Key<$variable>,)+);
            type Borrowed<'a> = ($(&'a $variable,)+);
            type Over<T: Scalar> = ($($variable::Over<T>,)+);
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
            fn retract_over<T: Scalar>(variables: &Self::Borrowed<'_>, delta: impl Fn(usize) -> T) -> Self::Over<T> {
                let mut next = 0;
                ($({
                    let offset = next;
                    next += $variable::DIM;
                    let _ = next;
                    variables.$index.retract_over(|i| delta(offset + i))
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

/// The residual without derivatives.
#[inline(always)]
pub(crate) fn value<F: Factor<M> + ?Sized, const M: usize>(
    factor: &F,
    variables: &Borrowed<'_, F::Variables>,
) -> SVector<f64, M> {
    factor.residual(<F::Variables as VariableTuple>::retract_over(variables, |_| 0.0))
}

/// Derivatives per dual number. Four of them fit into vector registers; wider dual numbers are many times slower.
const WIDTH: usize = 4;

/// Returns the residual and writes its Jacobian, row-major M × DIM.
#[inline(always)]
fn differentiate<F: Factor<M> + ?Sized, const M: usize>(
    factor: &F,
    variables: &Borrowed<'_, F::Variables>,
    jacobian: &mut [f64],
) -> SVector<f64, M> {
    let dim = <F::Variables as VariableTuple>::DIM;
    let mut residual = SVector::zeros();
    for first in (0..dim).step_by(WIDTH) {
        let dual = <F::Variables as VariableTuple>::retract_over(variables, |i| seed(i.wrapping_sub(first)));
        let dual: SVector<DualSVec64<WIDTH>, M> = factor.residual(dual);
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

/// The dual number 0 with derivative 1 in direction `i`, or with no derivative if `i` is not below `WIDTH`.
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
