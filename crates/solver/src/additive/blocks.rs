//! Products of all columns of an additive model, by blocks of clusters: everything else is algebra on these.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, RealField};
use rayon::prelude::*;

use super::axis::SUPPORT;
use super::model::{Additive, Cluster, Group};
use super::penalty::{Information, STRENGTH, block_diagonal};

/// Blocks of consecutive clusters, of which one is left out at a time.
const BLOCKS: usize = 6;
/// Strengths that are compared for groups that take part.
const STRENGTHS: [f64; 5] = [1e-5, 1e-4, 1e-3, STRENGTH, 1e-1];
/// Share of its information that a group has to keep where the shared parameters are free: else it is one of these.
const LEAST_SHARE: f64 = 1e-3;

/// A block of clusters against all others. With the shared parameters at the optimum of the others, the cost of either is, up to
/// a constant, gᵀw + ½ wᵀHw in the columns w of all groups.
struct LeftOut {
    /// Products of the block's columns with each other, in single precision: there is one for every block, and the penalties are
    /// far above its rounding.
    own: DMatrix<f32>,
    /// The products that the shared parameters take from the others are those of its columns.
    taken: DMatrix<f64>,
    /// g of the others.
    gradient: DVector<f64>,
    /// By how much the shared parameters fall with every column.
    carried: DMatrix<f64>,
    /// Products of the shared parameters in the block, with each other and with the columns.
    shared: DMatrix<f64>,
    cross: DMatrix<f64>,
    /// g of the block.
    held_out_gradient: DVector<f64>,
}

/// The products of all columns by blocks of clusters.
pub(super) struct Blocks {
    ranges: Vec<Range<usize>>,
    /// Products of all columns with each other, over all clusters.
    total: DMatrix<f32>,
    left_out: Vec<LeftOut>,
    information: Vec<Information>,
    /// Penalty of every group.
    pub penalties: Vec<DMatrix<f64>>,
    /// Numbers of the groups that are more than the shared parameters.
    pub tested: Vec<usize>,
}

/// The block of a cluster.
pub(super) fn block_of(cluster: usize, clusters: usize) -> usize {
    cluster * blocks_of(clusters) / clusters.max(1)
}

/// The number of blocks.
pub(super) fn blocks_of(clusters: usize) -> usize {
    BLOCKS.min(clusters)
}

/// Normal equations over the shared parameters and the columns of all groups.
struct Products<T> {
    shared: DMatrix<f64>,
    shared_gradient: DVector<f64>,
    cross: DMatrix<f64>,
    /// Of the columns with each other.
    own: DMatrix<T>,
    gradient: DVector<f64>,
    /// Sum of every column's entries over the rows.
    sums: Vec<f64>,
}

impl Blocks {
    /// The products of the clusters; `None` where they do not determine the shared parameters, or there are too few.
    pub fn of(model: &Additive<'_>) -> Option<Self> {
        let count = model.clusters.len();
        let blocks = blocks_of(count);
        let ranges = model.ranges();
        let width = ranges.last()?.end;
        if blocks < 3 {
            return None;
        }
        let of_block = |block: usize| {
            let mut products = Products::zeros(model.shared(), width);
            let clusters = model.clusters.iter().enumerate().filter(|(i, _)| block_of(*i, count) == block);
            clusters.for_each(|(_, cluster)| products.add(cluster, &model.groups, &ranges));
            products.in_single_precision()
        };
        let products: Vec<Products<f32>> = (0..blocks).into_par_iter().map(of_block).collect();
        let mut total = Products::zeros(model.shared(), width);
        products.iter().for_each(|block| total.sum(block));
        let visible = total.visible()?;
        let trace = |diagonal: &dyn Fn(usize) -> f64| -> Vec<f64> {
            ranges.iter().map(|columns| columns.clone().map(diagonal).sum()).collect()
        };
        let information = trace(&|i| visible[i]);
        let alone = trace(&|i| f64::from(total.own[(i, i)]));
        let tested = (0..information.len()).filter(|g| information[*g] > LEAST_SHARE * alone[*g]).collect();
        let of_group = |(columns, total_of_group): (&Range<usize>, f64)| {
            let sums = DVector::from_column_slice(&total.sums[columns.clone()]);
            Information { total: total_of_group, sums }
        };
        let information: Vec<Information> = ranges.iter().zip(information).map(of_group).collect();
        let penalty = |(group, information): (&Group, &Information)| information.penalty(group, STRENGTH);
        let penalties = model.groups.iter().zip(&information).map(penalty).collect();
        let left_out: Option<Vec<LeftOut>> = products.into_par_iter().map(|block| total.leaving_out(block)).collect();
        Some(Self { ranges, total: total.own, left_out: left_out?, information, penalties, tested })
    }

    /// Chooses the strengths of the penalties of some groups that predict the blocks best, one after the other.
    pub fn choose_strengths(&mut self, groups: &[usize], model: &Additive<'_>) {
        for group in groups {
            let compared = STRENGTHS.map(|strength| {
                self.penalties[*group] = self.information[*group].penalty(&model.groups[*group], strength);
                (self.gain(groups), strength)
            });
            let best = compared.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
            let (_, strength) = best.unwrap_or((0.0, STRENGTH));
            self.penalties[*group] = self.information[*group].penalty(&model.groups[*group], strength);
        }
    }

    /// The groups that are no members, sorted: first the one that, fitted with the members, lowers the cost most. The first block
    /// takes no part.
    pub fn most_promising(&self, members: &[usize]) -> Vec<usize> {
        let (total, others) = (&self.total, &self.left_out[0]);
        let columns: Vec<usize> = members.iter().flat_map(|g| self.ranges[*g].clone()).collect();
        let mut of_members = block_diagonal(members.iter().map(|g| &self.penalties[*g]));
        of_members += others.part(total, &columns, &columns);
        let Some(factor) = of_members.cholesky() else { return Vec::new() };
        let lower = factor.l();
        let solved = |matrix: &DMatrix<f64>| lower.solve_lower_triangular(matrix);
        let Some(pull) = solved(&DMatrix::from_fn(columns.len(), 1, |i, _| others.gradient[columns[i]])) else {
            return Vec::new();
        };
        let fall = |group: usize| {
            let of_group: Vec<usize> = self.ranges[group].clone().collect();
            let cross = solved(&others.part(total, &columns, &of_group))?;
            let mut left = &self.penalties[group] + others.part(total, &of_group, &of_group);
            left.gemm(-1.0, &cross.transpose(), &cross, 1.0);
            let gradient = DVector::from_fn(of_group.len(), |i, _| others.gradient[of_group[i]]) - cross.tr_mul(&pull);
            Some((group, gradient.dot(&left.cholesky()?.solve(&gradient))))
        };
        let candidates = self.tested.par_iter().copied().filter(|group| !members.contains(group));
        let mut falls: Vec<(usize, f64)> = candidates.filter_map(fall).collect();
        falls.sort_by(|a, b| b.1.total_cmp(&a.1));
        falls.into_iter().map(|(group, _)| group).collect()
    }

    /// Fall of the cost of all blocks, each left out, with some groups, which are given by their numbers.
    pub fn gain(&self, groups: &[usize]) -> f64 {
        let columns: Vec<usize> = groups.iter().flat_map(|g| self.ranges[*g].clone()).collect();
        let penalty = block_diagonal(groups.iter().map(|g| &self.penalties[*g]));
        self.left_out.iter().map(|part| part.gain(&self.total, &columns, &penalty)).sum()
    }
}

impl LeftOut {
    /// Some rows and columns of H of the others, given the products of all clusters.
    fn part(&self, total: &DMatrix<f32>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
        let mut part = DMatrix::zeros(rows.len(), columns.len());
        for (j, column) in columns.iter().enumerate() {
            let (of_all, of_block) = (total.column(*column), self.own.column(*column));
            (0..rows.len()).for_each(|i| part[(i, j)] = f64::from(of_all[rows[i]] - of_block[rows[i]]));
        }
        let (of_rows, of_columns) = (self.taken.select_columns(rows).transpose(), self.taken.select_columns(columns));
        part.gemm(-1.0, &of_rows, &of_columns, 1.0);
        part
    }

    /// Fall of the block's cost with the columns at the optimum of the others.
    fn gain(&self, total: &DMatrix<f32>, columns: &[usize], penalty: &DMatrix<f64>) -> f64 {
        let n = columns.len();
        let hessian = self.part(total, columns, columns) + penalty;
        let Some(factor) = hessian.cholesky() else { return 0.0 };
        let step = factor.solve(&DVector::from_fn(n, |i, _| -self.gradient[columns[i]]));
        let along = |matrix: &DMatrix<f64>| matrix.select_columns(columns) * &step;
        let (fallen, cross) = (along(&self.carried), along(&self.cross));
        let mut change = fallen.dot(&(0.5 * &self.shared * &fallen - cross));
        for (j, column) in columns.iter().enumerate() {
            let of_column = self.own.column(*column);
            let product: f64 = (0..n).map(|i| f64::from(of_column[columns[i]]) * step[i]).sum();
            change += step[j] * (self.held_out_gradient[*column] + 0.5 * product);
        }
        if change.is_finite() { -change } else { 0.0 }
    }
}

impl<T: RealField> Products<T> {
    fn zeros(shared: usize, width: usize) -> Self {
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
    /// Adds the rows of a cluster. Columns are sparse until its own variables are eliminated, which takes off a product of
    /// low rank.
    fn add(&mut self, cluster: &Cluster<'_>, groups: &[Group], ranges: &[Range<usize>]) {
        let rows = cluster.rows.matrix();
        let kinds = rows.ncols();
        let (local, shared) = (cluster.rows.local(), cluster.rows.shared());
        let mut with_rows = DMatrix::zeros(kinds, self.gradient.len());
        let mut of_row: Vec<(usize, [f64; SUPPORT], usize)> = Vec::with_capacity(2 * groups.len());
        for row in 0..rows.nrows() {
            of_row.clear();
            for (group, columns) in groups.iter().zip(ranges) {
                let count = columns.len().min(SUPPORT);
                let take = |first, entries| of_row.push((columns.start + first, entries, count));
                group.runs(&cluster.table, row, take);
            }
            for (i, (start, entries, count)) in of_row.iter().enumerate() {
                for a in 0..*count {
                    let entry = entries[a];
                    if entry == 0.0 {
                        continue;
                    }
                    let column = start + a;
                    for kind in 0..kinds {
                        with_rows[(kind, column)] += rows[(row, kind)] * entry;
                    }
                    self.sums[column] += entry.abs();
                    let mut products = self.own.column_mut(column);
                    let products = products.as_mut_slice();
                    for (other, values, count) in &of_row[i..] {
                        // Of a run of fewer the further values are zero.
                        match products[*other..].first_chunk_mut::<SUPPORT>() {
                            Some(products) => (0..SUPPORT).for_each(|b| products[b] += entry * values[b]),
                            None => (0..*count).for_each(|b| products[other + b] += entry * values[b]),
                        }
                    }
                }
            }
        }
        let of_own = with_rows.rows(0, local);
        self.own.gemm(-1.0, &of_own.transpose(), &of_own, 1.0);
        self.cross += with_rows.rows(local, shared);
        self.gradient += with_rows.row(local + shared).transpose();
        self.shared += cluster.rows.hessian();
        self.shared_gradient += cluster.rows.gradient();
    }

    /// Products of the columns with each other, of which the lower triangle is known by now, in both triangles.
    fn in_single_precision(mut self) -> Products<f32> {
        self.own.fill_upper_triangle_with_lower_triangle();
        let Self { shared, shared_gradient, cross, own, gradient, sums } = self;
        Products { shared, shared_gradient, cross, own: own.cast(), gradient, sums }
    }
}

impl Products<f32> {
    fn sum(&mut self, block: &Self) {
        self.shared += &block.shared;
        self.shared_gradient += &block.shared_gradient;
        self.cross += &block.cross;
        self.own += &block.own;
        self.gradient += &block.gradient;
        self.sums.iter_mut().zip(&block.sums).for_each(|(sum, of_block)| *sum += of_block);
    }

    /// Information on every column that the shared parameters leave.
    fn visible(&self) -> Option<Vec<f64>> {
        let carried = self.shared.clone().cholesky()?.solve(&self.cross);
        let taken = |column: usize| self.cross.column(column).dot(&carried.column(column));
        Some((0..self.own.ncols()).map(|column| f64::from(self.own[(column, column)]) - taken(column)).collect())
    }

    /// A block, whose products are these, against all others, with `self` the sum over all blocks.
    fn leaving_out(&self, block: Self) -> Option<LeftOut> {
        let factor = (&self.shared - &block.shared).cholesky()?;
        let cross = &self.cross - &block.cross;
        let taken = factor.l_dirty().solve_lower_triangular(&cross)?;
        let carried = factor.solve(&cross);
        let step = factor.solve(&(&block.shared_gradient - &self.shared_gradient));
        let gradient = &self.gradient - &block.gradient + cross.tr_mul(&step);
        // With the shared parameters at `step` − `carried` w.
        let shared_gradient = &block.shared_gradient + &block.shared * &step;
        let held_out_gradient = &block.gradient + block.cross.tr_mul(&step) - carried.tr_mul(&shared_gradient);
        let Self { shared, cross, own, .. } = block;
        Some(LeftOut { own, taken, gradient, carried, shared, cross, held_out_gradient })
    }
}
