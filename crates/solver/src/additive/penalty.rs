//! The penalty of a group's coefficients: roughness, and weakly their mean and their size.

use nalgebra::{DMatrix, DVector};

use super::axis::smoothness_precision;
use super::model::Group;

/// Share of a group's information that the penalty of its smoothness has where it is not chosen.
pub const STRENGTH: f64 = 1e-2;
/// Precision of the mean of a smooth function, as a share of its information: a constant is a group of its own.
const CENTRED: f64 = 0.1;
/// Ridge on a group relative to its information, for combinations that the shared parameters take up.
const RIDGE: f64 = 1e-3;

/// Information on a group: what its penalty is a share of.
#[derive(Debug, Clone)]
pub(super) struct Information {
    /// Trace of its normal matrix.
    pub total: f64,
    /// Sum of every basis function over the rows.
    pub sums: DVector<f64>,
}

/// Precision of a group's coefficients.
#[derive(Debug, Clone, Copy)]
pub struct Precision {
    /// Of second differences.
    pub roughness: f64,
    /// Of single coefficients about zero.
    pub ridge: f64,
}

impl Information {
    /// Precision of second differences and of single coefficients of a group at a strength.
    pub fn precision(&self, group: &Group, strength: f64) -> Precision {
        let total = self.total.max(f64::MIN_POSITIVE);
        let axes = group.splines();
        let trace = if axes.is_empty() { 1.0 } else { smoothness_precision(&axes).trace() };
        Precision { roughness: strength * total / trace, ridge: RIDGE * total / self.sums.len() as f64 }
    }

    /// Normal matrix of the penalty of a group at a strength.
    pub fn penalty(&self, group: &Group, strength: f64) -> DMatrix<f64> {
        let Precision { roughness, ridge } = self.precision(group, strength);
        let mut penalty = DMatrix::identity(self.sums.len(), self.sums.len()) * ridge;
        let axes = group.splines();
        if !axes.is_empty() {
            penalty += smoothness_precision(&axes) * roughness;
            let mean = self.sums.normalize();
            penalty += &mean * mean.transpose() * (CENTRED * self.total);
        }
        penalty
    }
}

/// Penalties of groups, one after the other, as that of all their columns.
pub(super) fn block_diagonal<'a>(penalties: impl IntoIterator<Item = &'a DMatrix<f64>>) -> DMatrix<f64> {
    let penalties: Vec<&DMatrix<f64>> = penalties.into_iter().collect();
    let size = penalties.iter().map(|penalty| penalty.nrows()).sum();
    let mut whole = DMatrix::zeros(size, size);
    let mut start = 0;
    for penalty in penalties {
        whole.view_mut((start, start), penalty.shape()).copy_from(penalty);
        start += penalty.nrows();
    }
    whole
}
