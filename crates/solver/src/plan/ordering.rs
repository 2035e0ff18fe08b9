//! Fill-reducing ordering of a sparse Cholesky factorisation, and its work.
//!
//! Variables are ordered instead of scalar components (approximate minimum degree, Amestoy, Davis and Duff 1996): all
//! columns of a variable have the same sparsity pattern, and a graph of poses is 36 times smaller than the matrix of
//! their components.

use faer::Side;
use faer::perm::Perm;
use faer::prelude::Reborrow;
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};

use crate::problem::error::StructureError;

/// The block sparsity pattern of a symmetric system: its variables, and the pairs of them that a factor links.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlockGraph {
    /// Number of components of each variable.
    pub dims: Vec<u32>,
    /// (column, row) with row > column, sorted, each once.
    pub links: Vec<(u32, u32)>,
}

/// A fill-reducing order and the work of a factorisation in this order.
#[derive(Clone, Debug)]
pub(crate) struct Ordering {
    /// The variables in the order of elimination.
    pub order: Vec<u32>,
    /// Floating-point operations.
    pub flops: f64,
}

impl BlockGraph {
    pub fn new(dims: Vec<u32>, mut links: Vec<(u32, u32)>) -> Self {
        links.sort_unstable();
        links.dedup();
        Self { dims, links }
    }

    /// Whether this graph has the same variables as another one, all links of it, and at most twice as many.
    pub fn covers(&self, other: &Self) -> bool {
        let mut ours = self.links.iter();
        self.dims == other.dims
            && self.links.len() <= 2 * other.links.len().max(8)
            && other.links.iter().all(|link| ours.any(|l| l == link))
    }

    /// Orders the variables and counts the operations of a factorisation.
    pub fn analyse(&self) -> Result<Ordering, StructureError> {
        let n = self.dims.len();
        let mut start = Vec::with_capacity(n + 1);
        let mut rows = Vec::with_capacity(n + self.links.len());
        let mut links = self.links.iter().peekable();
        start.push(0);
        for column in 0..n as u32 {
            rows.push(column as usize);
            while let Some((_, row)) = links.next_if(|(c, _)| *c == column) {
                rows.push(*row as usize);
            }
            start.push(rows.len());
        }
        let pattern = SymbolicSparseColMat::<usize>::new_checked(n, n, start, None, rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..CholeskySymbolicParams::default()
        };
        let symbolic = factorize_symbolic_cholesky(pattern.rb(), Side::Lower, SymmetricOrdering::Amd, params)
            .map_err(|e| linear_system(&e))?;
        let order: Vec<u32> = match symbolic.perm() {
            Some(perm) => perm.arrays().0.iter().map(|v| *v as u32).collect(),
            None => (0..n as u32).collect(),
        };
        let mut flops = 0.0;
        if let SymbolicCholeskyRaw::Simplicial(factor) = symbolic.raw() {
            for (column, range) in factor.col_ptr().windows(2).enumerate() {
                let below = factor.row_idx()[range[0]..range[1]].iter().filter(|row| **row != column);
                let width: u32 = below.map(|row| self.dims[order[*row] as usize]).sum();
                flops += eliminate_flops(self.dims[order[column] as usize], width);
            }
        }
        Ok(Ordering { order, flops })
    }
}

/// Floating-point operations to eliminate a variable of `d` components that is linked to `width` other components.
pub(crate) fn eliminate_flops(d: u32, width: u32) -> f64 {
    let (d, w) = (f64::from(d), f64::from(width));
    d * d * d / 3.0 + d * d * w + d * w * w
}

/// The permutation of scalar components that follows from an order of variables. `first` has each variable's first
/// component, `dims` its number of components.
pub(crate) fn permutation(order: &[u32], first: &[usize], dims: &[u32]) -> Perm<usize> {
    let components = |v: &u32| first[*v as usize]..first[*v as usize] + dims[*v as usize] as usize;
    let forward: Vec<usize> = order.iter().flat_map(components).collect();
    let mut inverse = vec![0; forward.len()];
    forward.iter().enumerate().for_each(|(new, old)| inverse[*old] = new);
    let n = forward.len();
    Perm::new_checked(forward.into(), inverse.into(), n)
}

/// An error of the linear algebra library as a [`StructureError`].
pub(crate) fn linear_system(error: &dyn std::fmt::Debug) -> StructureError {
    StructureError::LinearSystem { reason: format!("{error:?}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eliminating the leaves of a star first causes no fill.
    #[test]
    fn a_star_is_ordered_from_its_leaves() {
        let graph = BlockGraph::new(vec![6, 3, 3, 3], vec![(0, 1), (0, 2), (0, 3)]);
        let ordering = graph.analyse().unwrap();
        // Once a single leaf is left, the centre may come before it without fill.
        assert!(ordering.order.iter().position(|v| *v == 0).unwrap() >= 2, "{ordering:?}");
        let leaves = 3.0 * eliminate_flops(3, 6) + eliminate_flops(6, 0);
        let centre = 2.0 * eliminate_flops(3, 6) + eliminate_flops(6, 3) + eliminate_flops(3, 0);
        assert!(ordering.flops == leaves || ordering.flops == centre, "{ordering:?}");
    }
}
