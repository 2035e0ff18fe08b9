//! Products of all columns of an additive model, by blocks of clusters: everything else is algebra on these.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::model::{Additive, Cluster, Group, ranges};
use super::penalty::{Information, STRENGTH, block_diagonal};
use super::products::Products;

/// Blocks of consecutive clusters, of which one is left out at a time, and the fewest.
const BLOCKS: usize = 6;
const LEAST_BLOCKS: usize = 3;
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
pub(super) struct Blocks<'a> {
    groups: Vec<&'a Group>,
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

/// The clusters of a model by blocks; `None` of too few.
pub(super) fn by_blocks<'a>(model: &'a Additive<'_>) -> Option<Vec<Vec<&'a Cluster<'a>>>> {
    let count = model.clusters.len();
    let mut blocks = vec![Vec::new(); blocks_of(count)];
    let clusters = model.clusters.iter().enumerate();
    clusters.for_each(|(number, cluster)| blocks[block_of(number, count)].push(cluster));
    (blocks.len() >= LEAST_BLOCKS).then_some(blocks)
}

impl<'a> Blocks<'a> {
    /// The products of the clusters; `None` where they do not determine the shared parameters, or there are too few.
    pub fn of(model: &'a Additive<'_>) -> Option<Self> {
        let groups: Vec<&Group> = model.groups.iter().collect();
        let ranges = ranges(groups.iter().copied());
        let of_block = |clusters: Vec<&Cluster<'_>>| {
            let mut products = Products::zeros(model.shared(), ranges.last().map_or(0, |last| last.end));
            clusters.into_iter().for_each(|cluster| drop(products.add(cluster, &groups, &ranges)));
            products.in_single_precision()
        };
        let products = by_blocks(model)?.into_par_iter().map(of_block).collect();
        Self::of_products(groups, products)
    }

    /// From the products of some groups in every block; `None` where they do not determine the shared parameters, and of none.
    pub fn of_products(groups: Vec<&'a Group>, products: Vec<Products<f32>>) -> Option<Self> {
        let ranges = ranges(groups.iter().copied());
        let mut total = Products::zeros(products.first()?.shared.ncols(), ranges.last()?.end);
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
        let penalty = |(group, information): (&&Group, &Information)| information.penalty(group, STRENGTH);
        let penalties = groups.iter().zip(&information).map(penalty).collect();
        let left_out: Option<Vec<LeftOut>> = products.into_par_iter().map(|block| LeftOut::of(block, &total)).collect();
        Some(Self { groups, ranges, total: total.own, left_out: left_out?, information, penalties, tested })
    }

    /// Chooses the strengths of the penalties of some groups that predict the blocks best, one after the other.
    pub fn choose_strengths(&mut self, groups: &[usize]) {
        for group in groups {
            let compared = STRENGTHS.map(|strength| {
                self.penalties[*group] = self.information[*group].penalty(self.groups[*group], strength);
                (self.gain(groups), strength)
            });
            let best = compared.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
            let (_, strength) = best.unwrap_or((0.0, STRENGTH));
            self.penalties[*group] = self.information[*group].penalty(self.groups[*group], strength);
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
    /// A block with these products against all others, given the products of all blocks.
    fn of(block: Products<f32>, all: &Products<f32>) -> Option<Self> {
        let factor = (&all.shared - &block.shared).cholesky()?;
        let cross = &all.cross - &block.cross;
        let taken = factor.l_dirty().solve_lower_triangular(&cross)?;
        let carried = factor.solve(&cross);
        let step = factor.solve(&(&block.shared_gradient - &all.shared_gradient));
        let gradient = &all.gradient - &block.gradient + cross.tr_mul(&step);
        // With the shared parameters at `step` − `carried` w.
        let shared_gradient = &block.shared_gradient + &block.shared * &step;
        let held_out_gradient = &block.gradient + block.cross.tr_mul(&step) - carried.tr_mul(&shared_gradient);
        let Products { shared, cross, own, .. } = block;
        Some(Self { own, taken, gradient, carried, shared, cross, held_out_gradient })
    }

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
