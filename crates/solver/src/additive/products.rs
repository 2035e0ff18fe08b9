//! Products of columns with each other, with the shared parameters and with the residuals.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, RealField};

use super::axis::SUPPORT;
use super::model::{Cluster, Group};

/// Consecutive entries of a row that are not zero: their first column, themselves, and how many there are.
pub(super) type Run = (usize, [f64; SUPPORT], usize);

/// Normal equations over the shared parameters and the columns of all groups.
pub(super) struct Products<T> {
    pub shared: DMatrix<f64>,
    pub shared_gradient: DVector<f64>,
    pub cross: DMatrix<f64>,
    /// Of the columns with each other.
    pub own: DMatrix<T>,
    pub gradient: DVector<f64>,
    /// Sum of every column's entries over the rows.
    pub sums: Vec<f64>,
}

/// Hands on the runs of a row of a cluster, those of one group after the other.
pub(super) fn runs_of<'a>(
    cluster: &Cluster<'_>,
    row: usize,
    groups: impl Iterator<Item = (&'a Group, &'a Range<usize>)>,
    mut take: impl FnMut(Run),
) {
    for (group, columns) in groups {
        let count = columns.len().min(SUPPORT);
        group.runs(&cluster.table, row, |first, entries| take((columns.start + first, entries, count)));
    }
}

/// Adds the products of an entry with runs to those of its column.
#[inline]
pub(super) fn add_products(of_column: &mut [f64], entry: f64, runs: &[Run]) {
    for (other, values, count) in runs {
        // Of a run of fewer the further values are zero.
        match of_column[*other..].first_chunk_mut::<SUPPORT>() {
            Some(products) => (0..SUPPORT).for_each(|b| products[b] += entry * values[b]),
            None => (0..*count).for_each(|b| of_column[other + b] += entry * values[b]),
        }
    }
}

impl<T: RealField> Products<T> {
    pub fn zeros(shared: usize, width: usize) -> Self {
        Self {
            shared: DMatrix::zeros(shared, shared),
            shared_gradient: DVector::zeros(shared),
            cross: DMatrix::zeros(shared, width),
            own: DMatrix::zeros(width, width),
            gradient: DVector::zeros(width),
            sums: vec![0.0; width],
        }
    }
}

impl Products<f64> {
    /// Adds the rows of a cluster. Columns are sparse until its own variables are eliminated, which takes off a product of low
    /// rank: that of what is returned, one row for each of these variables.
    pub fn add(&mut self, cluster: &Cluster<'_>, groups: &[&Group], ranges: &[Range<usize>]) -> DMatrix<f64> {
        let rows = cluster.rows.matrix();
        let kinds = rows.ncols();
        let (local, shared) = (cluster.rows.local(), cluster.rows.shared());
        let mut with_rows = DMatrix::zeros(kinds, self.gradient.len());
        let mut of_row: Vec<Run> = Vec::with_capacity(2 * groups.len());
        for row in 0..rows.nrows() {
            of_row.clear();
            runs_of(cluster, row, groups.iter().copied().zip(ranges), |run| of_row.push(run));
            for (i, (start, entries, count)) in of_row.iter().enumerate() {
                for (a, entry) in entries.iter().enumerate().take(*count).filter(|(_, entry)| **entry != 0.0) {
                    let column = start + a;
                    (0..kinds).for_each(|kind| with_rows[(kind, column)] += rows[(row, kind)] * entry);
                    self.sums[column] += entry.abs();
                    add_products(self.own.column_mut(column).as_mut_slice(), *entry, &of_row[i..]);
                }
            }
        }
        let of_own = with_rows.rows(0, local).into_owned();
        self.own.gemm(-1.0, &of_own.transpose(), &of_own, 1.0);
        self.cross += with_rows.rows(local, shared);
        self.gradient += with_rows.row(local + shared).transpose();
        self.shared += cluster.rows.hessian();
        self.shared_gradient += cluster.rows.gradient();
        of_own
    }

    /// Products of the columns with each other, of which the lower triangle is known by now, in both triangles.
    pub fn in_single_precision(mut self) -> Products<f32> {
        self.own.fill_upper_triangle_with_lower_triangle();
        let Self { shared, shared_gradient, cross, own, gradient, sums } = self;
        Products { shared, shared_gradient, cross, own: own.cast(), gradient, sums }
    }
}

impl Products<f32> {
    /// Adds those of another block.
    pub fn sum(&mut self, block: &Self) {
        self.shared += &block.shared;
        self.shared_gradient += &block.shared_gradient;
        self.cross += &block.cross;
        self.own += &block.own;
        self.gradient += &block.gradient;
        self.sums.iter_mut().zip(&block.sums).for_each(|(sum, of_block)| *sum += of_block);
    }

    /// Information on every column that the shared parameters leave.
    pub fn visible(&self) -> Option<Vec<f64>> {
        let carried = self.shared.clone().cholesky()?.solve(&self.cross);
        let taken = |column: usize| self.cross.column(column).dot(&carried.column(column));
        Some((0..self.own.ncols()).map(|column| f64::from(self.own[(column, column)]) - taken(column)).collect())
    }
}
