//! Start values of a pose graph by chordal relaxation.

use nalgebra::{SMatrix, SVector};

use crate::normal::normal_equations::NormalEquations;
use crate::plan::linear_solver::LinearSolver;
use crate::pose_graph::error::PoseGraphError;
use crate::pose_graph::relative_pose::RelativePose;
use crate::pose_graph::rigid_motion::{RigidMotion, nearest_rotation};
use crate::pose_graph::tree_start::tree_start;
use crate::problem::autodiff::Scalar;
use crate::problem::batch::Batch;
use crate::problem::factor::{Factor, Over};
use crate::problem::graph::Graph;
use crate::problem::key::Key;
use crate::problem::values::Values;
use crate::step::error::SolveError;

/// √κ (r_j − R_ijᵀ r_i) for a row r of every rotation matrix: rows of R_j − R_i R_ij do not depend on each other.
struct RowOfRotation<const D: usize> {
    /// R_ijᵀ.
    transposed: SMatrix<f64, D, D>,
    weight: f64,
}

impl<const D: usize> Factor<D> for RowOfRotation<D> {
    type Variables = (SVector<f64, D>, SVector<f64, D>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, D> {
        let mut r = b;
        for i in 0..D {
            for j in 0..D {
                r[i] -= a[j] * self.transposed[(i, j)];
            }
            r[i] *= T::from(self.weight);
        }
        r
    }
}

/// √τ (t_j − t_i − R_i t_ij) for given rotations.
struct Displacement<const D: usize> {
    displacement: SVector<f64, D>,
    weight: f64,
}

impl<const D: usize> Factor<D> for Displacement<D> {
    type Variables = (SVector<f64, D>, SVector<f64, D>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, D> {
        let mut r = b;
        for i in 0..D {
            r[i] = (b[i] - a[i] - T::from(self.displacement[i])) * self.weight;
        }
        r
    }
}

/// Start values of `count` poses from their measured relative poses alone, with the first pose at the identity (Martinec and
/// Pajdla 2007; Carlone et al. 2015, section IV.A).
///
/// Rotations solve the linear least squares Σ κ ‖R_j − R_i R_ij‖² without the condition that they are rotations, and are then
/// replaced by the nearest rotations; translations solve Σ τ ‖t_j − t_i − R_i t_ij‖². Neither can end in a local minimum. The
/// work is two sparse factorisations of D unknowns a pose; the bits do not depend on the number of threads.
///
/// # Errors
/// [`PoseGraphError::Ends`]; [`PoseGraphError::Disconnected`]; [`PoseGraphError::Linear`] if numbers are not finite.
pub fn chordal_start<const D: usize>(
    count: usize,
    measurements: &[RelativePose<D>],
) -> Result<Vec<RigidMotion<D>>, PoseGraphError> {
    // Finds measurements between poses that do not exist, and poses without any.
    tree_start(count, measurements)?;
    if count < 2 {
        return Ok(vec![RigidMotion::identity(); count]);
    }
    let (rotations, system) = rotations(count, measurements)?;
    let factors = measurements.iter().map(|m| {
        let displacement = rotations[m.from] * m.motion.translation;
        (Displacement { displacement, weight: m.tau.sqrt() }, m)
    });
    let mut values = Values::new();
    let (graph, keys) = relative_graph(count, factors, &mut values);
    let mut system = factorized(Some(system), &graph, &values, "translations")?;
    let mut solution: Vec<f64> = system.gradient().iter().map(|g| -g).collect();
    system.solve_many(&mut solution);
    let translations = unknowns(&system, &keys, &solution);
    let poses = rotations.into_iter().zip(translations).map(|(rotation, t)| {
        let translation = t.unwrap_or_else(SVector::zeros);
        translation.iter().all(|x| x.is_finite()).then_some(RigidMotion { rotation, translation })
    });
    poses.collect::<Option<_>>().ok_or(PoseGraphError::Linear { part: "translations" })
}

/// The rotations of the relaxation: one factorisation for all rows of the rotation matrices. Returns the normal equations as
/// well: translations have the same pattern.
fn rotations<const D: usize>(
    count: usize,
    measurements: &[RelativePose<D>],
) -> Result<(Vec<SMatrix<f64, D, D>>, NormalEquations), PoseGraphError> {
    let failed = || PoseGraphError::Linear { part: "rotations" };
    let factors = measurements.iter().map(|m| {
        let transposed = m.motion.rotation.transpose();
        (RowOfRotation { transposed, weight: m.kappa.sqrt() }, m)
    });
    let mut values = Values::new();
    let (graph, keys) = relative_graph(count, factors, &mut values);
    let mut system = factorized(None, &graph, &values, "rotations")?;
    let mut matrices = vec![SMatrix::<f64, D, D>::identity(); count];
    let mut solution = Vec::with_capacity(system.dim() * D);
    for row in 0..D {
        // The rows of the first rotation, the identity, are the right-hand sides; H depends on no value.
        values.set(keys[0], SVector::from_fn(|i, _| if i == row { 1.0 } else { 0.0 }));
        system.linearize(&values).map_err(SolveError::from)?;
        solution.extend(system.gradient().iter().map(|g| -g));
    }
    system.solve_many(&mut solution);
    for (row, solution) in solution.chunks_exact(system.dim()).enumerate() {
        for (matrix, r) in matrices.iter_mut().zip(unknowns(&system, &keys, solution)) {
            r.into_iter().for_each(|r| matrix.set_row(row, &r.transpose()));
        }
    }
    let rotations = matrices.iter().map(nearest_rotation).collect::<Option<_>>().ok_or_else(failed)?;
    Ok((rotations, system))
}

/// A graph of one vector per pose, all zero, of which the first is fixed.
fn relative_graph<'a, F, const D: usize>(
    count: usize,
    factors: impl Iterator<Item = (F, &'a RelativePose<D>)>,
    values: &mut Values,
) -> (Graph, Vec<Key<SVector<f64, D>>>)
where
    F: Factor<D, Variables = (SVector<f64, D>, SVector<f64, D>)>,
{
    let keys: Vec<_> = (0..count).map(|_| values.insert(SVector::<f64, D>::zeros())).collect();
    let mut batch = Batch::new("relative poses");
    factors.for_each(|(factor, m)| batch.push(factor, (keys[m.from], keys[m.to])));
    let mut graph = Graph::new();
    graph.add_batch(batch);
    graph.fix(keys[0]);
    (graph, keys)
}

/// The normal equations of a graph, factorised, with the ordering of previous ones.
fn factorized(
    previous: Option<NormalEquations>,
    graph: &Graph,
    values: &Values,
    part: &'static str,
) -> Result<NormalEquations, PoseGraphError> {
    let wanted = LinearSolver::SparseCholesky;
    let mut system = NormalEquations::reuse(previous, graph, values, wanted, true).map_err(SolveError::from)?;
    system.linearize(values).map_err(SolveError::from)?;
    let none = vec![0.0; system.dim()];
    if system.factorize(0.0, &none) { Ok(system) } else { Err(PoseGraphError::Linear { part }) }
}

/// The part of a solution that belongs to each pose; `None` for the first one, which is fixed.
fn unknowns<const D: usize>(
    system: &NormalEquations,
    keys: &[Key<SVector<f64, D>>],
    solution: &[f64],
) -> Vec<Option<SVector<f64, D>>> {
    let part = |key: &Key<_>| {
        let active = system.layout.find(key.id())?;
        Some(SVector::from_column_slice(&solution[active.offset..][..D]))
    };
    keys.iter().map(part).collect()
}
