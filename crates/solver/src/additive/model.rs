//! The additive model: groups of columns, each a smooth function of one or two covariates times a weight.

use std::collections::BTreeSet;
use std::ops::Range;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::axis::{Axis, SUPPORT};
use super::normal::Normal;
use super::rows::ClusterRows;

/// A smooth function of one covariate or of two, or a constant, times a weight: a group of columns.
#[derive(Debug, Clone)]
pub struct Group {
    /// Columns of [`Table::covariates`] with the splines along them: one or two, or none of a constant.
    pub axes: Vec<(usize, Axis)>,
    /// Column of [`Table::weights`]: change of the residual where the function is 1.
    pub weight: usize,
    /// Numbers of all quantities that the product depends on, in the caller's order: groups with the same ones are one function.
    pub covariates: BTreeSet<usize>,
    /// Words for logs.
    pub words: String,
}

impl Group {
    /// Number of its columns.
    pub fn count(&self) -> usize {
        self.axes.iter().map(|(_, axis)| axis.count).product()
    }

    /// Its axes alone.
    pub(super) fn splines(&self) -> Vec<Axis> {
        self.axes.iter().map(|(_, axis)| *axis).collect()
    }

    /// Hands on the entries of a row that are not zero in runs, by the number of the first, counted within the group: of a
    /// function of one covariate one run, of two one for every basis function along the second, of a constant its one column.
    #[inline]
    pub(super) fn runs(&self, table: &Table, row: usize, mut run: impl FnMut(usize, [f64; SUPPORT])) {
        let weight = table.weights[(row, self.weight)];
        let basis = |(covariate, axis): &(usize, Axis)| {
            let value = table.covariates[(row, *covariate)];
            if value.is_finite() { axis.basis(value) } else { (0, [0.0; SUPPORT]) }
        };
        match &self.axes[..] {
            [] => run(0, [weight, 0.0, 0.0, 0.0]),
            [along] => {
                let (first, values) = basis(along);
                run(first, values.map(|value| value * weight));
            }
            [along, across, ..] => {
                let ((first, values), (first_row, of_rows)) = (basis(along), basis(across));
                for (number, value) in of_rows.iter().enumerate() {
                    let first = (first_row + number) * along.1.count + first;
                    run(first, values.map(|entry| entry * value * weight));
                }
            }
        }
    }
}

/// Covariates and weights of the rows of a cluster, one row each.
#[derive(Debug, Clone)]
pub struct Table {
    /// Covariates of the groups' splines; NaN where unknown.
    pub covariates: DMatrix<f64>,
    /// Weights of the groups.
    pub weights: DMatrix<f64>,
}

/// A cluster: its rows, and what they depend on.
#[derive(Debug, Clone)]
pub struct Cluster<'a> {
    /// Residuals and columns of the fitted variables.
    pub rows: &'a ClusterRows,
    /// Covariates and weights of the rows.
    pub table: Table,
}

/// Residuals of all clusters, and the groups of functions that they may depend on.
#[derive(Debug)]
pub struct Additive<'a> {
    /// The clusters, in their order in time where they have one; all with the same shared columns.
    pub clusters: Vec<Cluster<'a>>,
    /// The groups.
    pub groups: Vec<Group>,
    /// Quantities that grow with the number of the cluster, such as time: blocks of consecutive clusters are then extrapolations.
    pub sequential: BTreeSet<usize>,
}

impl Additive<'_> {
    /// Number of shared columns.
    pub fn shared(&self) -> usize {
        self.clusters.first().map_or(0, |cluster| cluster.rows.shared())
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.clusters.iter().map(|cluster| cluster.rows.matrix().nrows()).sum()
    }

    /// Words for some of its groups.
    pub(super) fn words(&self, groups: &[usize]) -> String {
        groups.iter().map(|group| self.groups[*group].words.as_str()).collect::<Vec<_>>().join(" + ")
    }

    /// ½ Σ r² of all rows.
    pub fn cost(&self) -> f64 {
        self.clusters.iter().map(|cluster| cluster.rows.cost()).sum()
    }

    /// Normal equations of every cluster over the shared columns and those of some groups, one after the other.
    pub fn normals(&self, groups: &[usize]) -> Vec<Normal> {
        self.clusters.par_iter().map(|cluster| cluster.rows.normal(&self.columns(cluster, groups))).collect()
    }

    fn columns(&self, cluster: &Cluster<'_>, groups: &[usize]) -> DMatrix<f64> {
        let width: usize = groups.iter().map(|g| self.groups[*g].count()).sum();
        let rows = cluster.rows.matrix().nrows();
        let mut columns = DMatrix::zeros(rows, width);
        for row in 0..rows {
            let mut start = 0;
            for group in groups.iter().map(|g| &self.groups[*g]) {
                let count = group.count();
                group.runs(&cluster.table, row, |first, entries| {
                    for (i, entry) in entries.iter().enumerate().take(count) {
                        columns[(row, start + first + i)] = *entry;
                    }
                });
                start += count;
            }
        }
        columns
    }
}

/// The columns of every group among those of all, one after the other.
pub(super) fn ranges<'a>(groups: impl Iterator<Item = &'a Group>) -> Vec<Range<usize>> {
    let mut start = 0;
    let range = |group: &Group| {
        let range = start..start + group.count();
        start = range.end;
        range
    };
    groups.map(range).collect()
}
