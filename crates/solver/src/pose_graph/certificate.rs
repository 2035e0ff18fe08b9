//! The certificate that poses are globally optimal.

use nalgebra::{SMatrix, SVector};

use crate::normal::normal_equations::NormalEquations;
use crate::plan::linear_solver::LinearSolver;
use crate::pose_graph::error::PoseGraphError;
use crate::pose_graph::relative_pose::{RelativePose, chordal_objective};
use crate::pose_graph::rigid_motion::RigidMotion;
use crate::problem::autodiff::Scalar;
use crate::problem::batch::Batch;
use crate::problem::factor::{Factor, Over};
use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::step::error::SolveError;

/// Relative gaps that are tried, one after the other.
const GAPS: std::ops::RangeInclusive<i32> = -10..=0;

/// A lower bound of SE-Sync's objective over all poses, beside the objective of some.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// SE-Sync's objective of the poses: [`chordal_objective`].
    pub objective: f64,
    /// A number that no poses whatever have an objective below, up to rounding errors; `None` if none is found that is above
    /// zero, which says nothing about the poses where noise is large.
    pub lower_bound: Option<f64>,
    /// η, with which the matrix S + η I was positive definite: minus its least eigenvalue is no larger. Units of κ.
    pub regularization: Option<f64>,
}

impl Certificate {
    /// (objective − lower bound) / objective: by no more are the poses from the global optimum, relatively.
    pub fn relative_gap(&self) -> Option<f64> {
        self.lower_bound.map(|bound| (self.objective - bound) / self.objective)
    }
}

/// A row (r, t) of [R_i t_i] of both ends: √κ (r_j − R_ijᵀ r_i) and √τ (t_j − t_i − r_i · t_ij), of which the first D
/// components of the variables' four are r, the last one is t, and one is unused in the plane.
struct Row<const D: usize> {
    motion: RigidMotion<D>,
    weights: [f64; 2],
}

impl<const D: usize> Factor<4> for Row<D> {
    type Variables = (SVector<f64, 4>, SVector<f64, 4>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 4> {
        let [wr, wt] = self.weights;
        let mut e = SVector::<T, 4>::from_element(T::from(0.0));
        let mut t = b[3] - a[3];
        for i in 0..D {
            e[i] = b[i];
            for j in 0..D {
                e[i] -= a[j] * self.motion.rotation[(j, i)];
            }
            e[i] *= T::from(wr);
            t -= a[i] * self.motion.translation[i];
        }
        e[3] = t * wt;
        e
    }
}

/// Looks for a lower bound of SE-Sync's objective over all poses, by the dual problem (Rosen et al. 2019, section 4): with M
/// the matrix of the quadratic form tr X M Xᵀ = objective for X = [R₁ t₁ R₂ t₂ …] and Λ the block-diagonal matrix of the
/// symmetric parts of Rᵢᵀ (X M)ᵢ, S = M − Λ + η I ≥ 0, with I over the rotations, says that no poses have an objective below
/// tr Λ − η D n.
///
/// At the global optimum η is zero up to rounding errors, if the noise is not far beyond that of usual measurements. The bound
/// holds for whatever poses Λ was made from. The work is at least one sparse factorisation of (D + 1) unknowns a pose. The value
/// of the first translation is a choice and is held.
///
/// # Errors
/// [`PoseGraphError::Ends`]; [`PoseGraphError::Solve`] if numbers are not finite.
pub fn certify<const D: usize>(
    poses: &[RigidMotion<D>],
    measurements: &[RelativePose<D>],
) -> Result<Certificate, PoseGraphError> {
    let objective = chordal_objective(poses, measurements)?;
    if poses.len() < 2 || objective == 0.0 {
        return Ok(Certificate { objective, lower_bound: Some(objective), regularization: Some(0.0) });
    }
    let multipliers = multipliers(poses, measurements);
    let trace: f64 = multipliers.iter().map(|m| m.trace()).sum();
    let mut system = quadratic_form(poses.len(), measurements)?;
    system.subtract_diagonal_blocks(|id, i, j| if i.max(j) < D { multipliers[id.index()][(i, j)] } else { 0.0 });
    let mut over_rotations = vec![0.0; system.dim()];
    for a in &system.layout.active {
        (0..D.min(a.free as usize)).for_each(|i| over_rotations[a.offset + i] = 1.0);
    }
    let dimension = (D * poses.len()) as f64;
    for exponent in GAPS {
        let eta = 10_f64.powi(exponent) * objective / dimension;
        if system.factorize(eta, &over_rotations) {
            let bound = trace - eta * dimension;
            let lower_bound = Some(bound).filter(|bound| *bound > 0.0);
            return Ok(Certificate { objective, lower_bound, regularization: Some(eta) });
        }
    }
    Ok(Certificate { objective, lower_bound: None, regularization: None })
}

/// The diagonal blocks of Λ.
fn multipliers<const D: usize>(poses: &[RigidMotion<D>], measurements: &[RelativePose<D>]) -> Vec<SMatrix<f64, D, D>> {
    let mut products = vec![SMatrix::<f64, D, D>::zeros(); poses.len()];
    for m in measurements {
        let (from, to) = (&poses[m.from], &poses[m.to]);
        // Half the derivatives of the objective by R_j and R_i.
        let rotation = (to.rotation - from.rotation * m.motion.rotation) * m.kappa;
        let translation = (to.translation - from.translation - from.rotation * m.motion.translation) * m.tau;
        products[m.to] += to.rotation.transpose() * rotation;
        let of_from = rotation * m.motion.rotation.transpose() + translation * m.motion.translation.transpose();
        products[m.from] -= from.rotation.transpose() * of_from;
    }
    products.iter().map(|p| (p + p.transpose()) * 0.5).collect()
}

/// M as normal equations of one row of X, with the first translation fixed.
fn quadratic_form<const D: usize>(
    count: usize,
    measurements: &[RelativePose<D>],
) -> Result<NormalEquations, PoseGraphError> {
    let mut values = Values::new();
    let keys: Vec<_> = (0..count).map(|_| values.insert(SVector::<f64, 4>::zeros())).collect();
    let mut batch = Batch::new("rows of poses");
    for m in measurements {
        let weights = [m.kappa.sqrt(), m.tau.sqrt()];
        batch.push(Row { motion: m.motion, weights }, (keys[m.from], keys[m.to]));
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    for (index, key) in keys.iter().enumerate() {
        let fixed: [bool; 4] = std::array::from_fn(|i| (D..3).contains(&i) || index == 0 && i == 3);
        if fixed.contains(&true) {
            graph.fix_partly(*key, &fixed);
        }
    }
    let wanted = LinearSolver::SparseCholesky;
    let mut system = NormalEquations::new(&graph, &values, wanted, true).map_err(SolveError::from)?;
    system.linearize(&values).map_err(SolveError::from)?;
    Ok(system)
}
