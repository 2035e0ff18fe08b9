//! Factors with automatic derivatives.

use std::fmt::Debug;

use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};

use crate::problem::autodiff::{AutoDiffVariable, Scalar};
use crate::problem::key::{Key, VariableId};
use crate::problem::unrolled::{UNROLLED, unrolled};
use crate::problem::values::Values;

/// A residual of static dimension M over a tuple of one to six variables.
///
/// A factor is one generic function, [`residual`](Self::residual); its Jacobian follows by forward differentiation with dual
/// numbers, one direction at a time. Do not branch on derivatives in it, and note that √0 has none. With
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
}

/// The variables `V` of a factor with components of the scalar type `T`.
pub type Over<V, T> = <V as VariableTuple>::Over<T>;

/// References to the variables of a factor.
pub type Borrowed<'a, V> = <V as VariableTuple>::Borrowed<'a>;

/// A tuple of one to six variables of static dimension.
pub trait VariableTuple: Sized + 'static {
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
    /// First column of each variable.
    #[doc(hidden)]
    const OFFSETS: [usize; 6];

    /// Appends the ids of the variables.
    fn ids(keys: &Self::Keys, ids: &mut Vec<VariableId>);
    /// References to the variables' values; `None` unless all keys belong to `values`.
    fn borrow<'a>(keys: &Self::Keys, values: &'a Values) -> Option<Self::Borrowed<'a>>;
    /// Copies of the variables.
    #[doc(hidden)]
    fn copies(variables: &Self::Borrowed<'_>) -> Self;
    /// References to the variables of this tuple.
    #[doc(hidden)]
    fn references(&self) -> Self::Borrowed<'_>;
    /// The variables retracted by the stacked tangent vector δ, to first order; `delta(i)` is δᵢ for i in
    /// 0..[`DIM`](Self::DIM).
    fn retract_over<T: Scalar>(variables: &Self::Borrowed<'_>, delta: impl Fn(usize) -> T) -> Self::Over<T>;
    /// The residual of a factor. Writes its Jacobian, row-major M × [`DIM`](Self::DIM), into one lane of `entries`.
    #[doc(hidden)]
    fn differentiate<F: Factor<M, Variables = Self> + ?Sized, const M: usize, const L: usize>(
        factor: &F,
        variables: &Self::Borrowed<'_>,
        entries: &mut [[f64; L]],
        lane: usize,
    ) -> [f64; M];
}

macro_rules! variable_tuple {
    ($count:literal; $($variable:ident $index:tt),+) => {
        impl<$($variable: AutoDiffVariable),+> VariableTuple for ($($variable,)+) {
            type Keys = ($(Key<$variable>,)+);
            type Borrowed<'a> = ($(&'a $variable,)+);
            type Over<T: Scalar> = ($($variable::Over<T>,)+);
            const DIM: usize = 0 $(+ $variable::DIM)+;
            const COUNT: usize = $count;
            const OFFSETS: [usize; 6] = {
                let dims: [usize; $count] = [$($variable::DIM),+];
                let mut offsets = [0; 6];
                let mut i = 1;
                while i < $count {
                    offsets[i] = offsets[i - 1] + dims[i - 1];
                    i += 1;
                }
                offsets
            };

            fn ids(keys: &Self::Keys, ids: &mut Vec<VariableId>) {
                ids.extend([$(keys.$index.id()),+]);
            }

            #[inline(always)]
            fn borrow<'a>(keys: &Self::Keys, values: &'a Values) -> Option<Self::Borrowed<'a>> {
                Some(($(values.try_get(keys.$index)?,)+))
            }

            #[inline(always)]
            fn copies(variables: &Self::Borrowed<'_>) -> Self {
                ($(variables.$index.clone(),)+)
            }

            #[inline(always)]
            fn references(&self) -> Self::Borrowed<'_> {
                ($(&self.$index,)+)
            }

            #[inline(always)]
            fn retract_over<T: Scalar>(variables: &Self::Borrowed<'_>, delta: impl Fn(usize) -> T) -> Self::Over<T> {
                ($(variables.$index.retract_over(|i| delta(const { Self::OFFSETS[$index] } + i)),)+)
            }

            #[inline(always)]
            fn differentiate<Fa: Factor<M, Variables = Self> + ?Sized, const M: usize, const L: usize>(
                factor: &Fa,
                variables: &Self::Borrowed<'_>,
                entries: &mut [[f64; L]],
                lane: usize,
            ) -> [f64; M] {
                let parts = ($(columns(factor, variables, const { Self::OFFSETS[$index] }, $variable::DIM),)+);
                // Written when all are known: the compiler cannot tell that writing does not change the factor.
                $(
                    let offset = const { Self::OFFSETS[$index] };
                    unrolled!(k < $variable::DIM.min(UNROLLED) => {
                        unrolled!(m < M => {
                            entries[m * Self::DIM + offset + k][lane] = parts.$index.columns[k][m];
                        });
                    });
                    for column in offset + UNROLLED..offset + $variable::DIM {
                        let dual = direction(factor, variables, column);
                        for m in 0..M {
                            entries[m * Self::DIM + column][lane] = derivative(&dual[m]);
                        }
                    }
                )+
                parts.0.residual
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

/// The first columns of a Jacobian for a variable, and the residual.
struct Columns<const M: usize> {
    residual: [f64; M],
    columns: [[f64; M]; UNROLLED],
}

/// The columns of a variable that begins at column `offset` and has `dim` columns, up to the first [`UNROLLED`] of them.
#[inline(always)]
fn columns<F: Factor<M> + ?Sized, const M: usize>(
    factor: &F,
    variables: &Borrowed<'_, F::Variables>,
    offset: usize,
    dim: usize,
) -> Columns<M> {
    let mut part = Columns { residual: [0.0; M], columns: [[0.0; M]; UNROLLED] };
    unrolled!(k < dim.min(UNROLLED) => {
        let dual = direction(factor, variables, offset + k);
        unrolled!(m < M => {
            part.residual[m] = dual[m].re;
            part.columns[k][m] = derivative(&dual[m]);
        });
    });
    part
}

/// The residual with its derivative in the direction of one column.
///
/// Dual numbers that do not depend on the direction carry no derivative, so that what does not is computed once for all columns,
/// as a real number. Wider dual numbers would do more, not less.
#[inline(always)]
fn direction<F: Factor<M> + ?Sized, const M: usize>(
    factor: &F,
    variables: &Borrowed<'_, F::Variables>,
    column: usize,
) -> SVector<DualSVec64<1>, M> {
    factor.residual(<F::Variables as VariableTuple>::retract_over(variables, |i| {
        let eps = if i == column { Derivative::some(SVector::from([1.0])) } else { Derivative::none() };
        DualSVec64::new(0.0, eps)
    }))
}

#[inline(always)]
fn derivative(dual: &DualSVec64<1>) -> f64 {
    dual.eps.0.map_or(0.0, |eps| eps[0])
}
