//! Products of many candidates with a few groups. Products of the candidates with each other would take much memory.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::blocks::{Blocks, by_blocks};
use super::model::{Additive, Cluster, Group, ranges};
use super::products::{Products, Run, add_products, runs_of};

/// Products of some groups of a model with each other, and of every candidate with these groups and with itself.
pub(super) struct CandidateProducts<'a> {
    model: &'a Additive<'a>,
    /// Columns of every group, by its number, and of all.
    columns: BTreeMap<usize, Range<usize>>,
    width: usize,
    blocks: Vec<OfBlock>,
}

/// Those of a block of clusters.
struct OfBlock {
    groups: Products<f32>,
    candidates: BTreeMap<usize, Strip<f32>>,
}

/// Products of the columns of a candidate.
struct Strip<T> {
    /// With the columns of the groups, and then with each other; a column for each of the candidate's.
    own: DMatrix<T>,
    /// With the shared parameters.
    cross: DMatrix<f64>,
    gradient: DVector<f64>,
    sums: Vec<f64>,
}

impl<'a> CandidateProducts<'a> {
    /// The products of a model's groups and candidates, which are given by their numbers; `None` of too few clusters.
    pub fn of(model: &'a Additive<'_>, groups: &[usize], candidates: &[usize]) -> Option<Self> {
        let of_groups: Vec<&Group> = groups.iter().map(|group| &model.groups[*group]).collect();
        let ranges = ranges(of_groups.iter().copied());
        let width = ranges.last().map_or(0, |last| last.end);
        let new: Vec<usize> = candidates.iter().copied().filter(|candidate| !groups.contains(candidate)).collect();
        let of_block = |clusters: Vec<&Cluster<'_>>| {
            let mut products = Products::zeros(model.shared(), width);
            let mut strips: Vec<Strip<f64>> =
                new.iter().map(|c| Strip::zeros(model.shared(), width, model.groups[*c].count())).collect();
            for cluster in clusters {
                let rows = 0..cluster.rows.matrix().nrows();
                let of_row = |row: usize| {
                    let mut runs: Vec<Run> = Vec::with_capacity(2 * ranges.len());
                    runs_of(cluster, row, of_groups.iter().copied().zip(&ranges), |run| runs.push(run));
                    runs
                };
                let runs: Vec<Vec<Run>> = rows.map(of_row).collect();
                let of_own = products.add(cluster, &of_groups, &ranges);
                let strips = new.iter().zip(&mut strips);
                strips.for_each(|(candidate, strip)| strip.add(cluster, &model.groups[*candidate], &runs, &of_own));
            }
            let strips = strips.into_iter().map(Strip::in_single_precision);
            OfBlock { groups: products.in_single_precision(), candidates: new.iter().copied().zip(strips).collect() }
        };
        let blocks = by_blocks(model)?.into_par_iter().map(of_block).collect();
        Some(Self { model, columns: groups.iter().copied().zip(ranges).collect(), width, blocks })
    }

    /// The products of some of its groups, and of a candidate or a further group, if any; `None` where they do not determine the
    /// shared parameters.
    pub fn blocks(&self, groups: &[usize], further: Option<usize>) -> Option<Blocks<'a>> {
        let groups: Vec<usize> = groups.iter().copied().chain(further).collect();
        let columns: Vec<usize> =
            groups.iter().filter_map(|group| self.columns.get(group).cloned()).flatten().collect();
        let products = |block: &OfBlock| {
            let strip = further.and_then(|candidate| block.candidates.get(&candidate));
            block.groups.picked(&columns, strip.map(|strip| (strip, self.width)))
        };
        let products = self.blocks.iter().map(products).collect();
        Blocks::of_products(groups.iter().map(|group| &self.model.groups[*group]).collect(), products)
    }
}

impl Strip<f64> {
    fn zeros(shared: usize, width: usize, count: usize) -> Self {
        Self {
            own: DMatrix::zeros(width + count, count),
            cross: DMatrix::zeros(shared, count),
            gradient: DVector::zeros(count),
            sums: vec![0.0; count],
        }
    }

    /// Adds the rows of a cluster; `runs` are those of the groups in every row, and `of_groups` the products of its own variables
    /// with them.
    fn add(&mut self, cluster: &Cluster<'_>, candidate: &Group, runs: &[Vec<Run>], of_groups: &DMatrix<f64>) {
        let rows = cluster.rows.matrix();
        let kinds = rows.ncols();
        let (local, shared) = (cluster.rows.local(), cluster.rows.shared());
        let (width, count) = (of_groups.ncols(), self.sums.len());
        let columns = width..width + count;
        let mut with_rows = DMatrix::zeros(kinds, count);
        let mut of_candidate: Vec<Run> = Vec::new();
        for (row, of_row) in runs.iter().enumerate() {
            of_candidate.clear();
            runs_of(cluster, row, std::iter::once((candidate, &columns)), |run| of_candidate.push(run));
            for (start, entries, count) in &of_candidate {
                for (a, entry) in entries.iter().enumerate().take(*count).filter(|(_, entry)| **entry != 0.0) {
                    let column = start + a - width;
                    (0..kinds).for_each(|kind| with_rows[(kind, column)] += rows[(row, kind)] * entry);
                    self.sums[column] += entry.abs();
                    let mut of_column = self.own.column_mut(column);
                    add_products(of_column.as_mut_slice(), *entry, of_row);
                    add_products(of_column.as_mut_slice(), *entry, &of_candidate);
                }
            }
        }
        let of_own = with_rows.rows(0, local);
        self.own.rows_mut(0, width).gemm(-1.0, &of_groups.transpose(), &of_own, 1.0);
        self.own.rows_mut(width, count).gemm(-1.0, &of_own.transpose(), &of_own, 1.0);
        self.cross += with_rows.rows(local, shared);
        self.gradient += with_rows.row(local + shared).transpose();
    }

    fn in_single_precision(self) -> Strip<f32> {
        let Self { own, cross, gradient, sums } = self;
        Strip { own: own.cast(), cross, gradient, sums }
    }
}

impl Products<f32> {
    /// The products of some of its columns, and of those of a candidate, if any; the candidate comes with the number of all
    /// columns, whose products come first in its strip.
    fn picked(&self, columns: &[usize], candidate: Option<(&Strip<f32>, usize)>) -> Self {
        let (known, count) = (columns.len(), candidate.map_or(0, |(strip, _)| strip.sums.len()));
        let mut picked = Self::zeros(self.shared.ncols(), known + count);
        picked.shared.copy_from(&self.shared);
        picked.shared_gradient.copy_from(&self.shared_gradient);
        for (place, column) in columns.iter().enumerate() {
            picked.cross.set_column(place, &self.cross.column(*column));
            picked.gradient[place] = self.gradient[*column];
            picked.sums[place] = self.sums[*column];
            let of_column = self.own.column(*column);
            columns.iter().enumerate().for_each(|(i, row)| picked.own[(i, place)] = of_column[*row]);
        }
        let Some((strip, width)) = candidate else { return picked };
        for j in 0..count {
            let place = known + j;
            picked.cross.set_column(place, &strip.cross.column(j));
            picked.gradient[place] = strip.gradient[j];
            picked.sums[place] = strip.sums[j];
            let of_column = strip.own.column(j);
            for (i, row) in columns.iter().enumerate() {
                (picked.own[(i, place)], picked.own[(place, i)]) = (of_column[*row], of_column[*row]);
            }
            (0..count).for_each(|i| picked.own[(known + i, place)] = of_column[width + i]);
        }
        picked
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::axis::{Axis, CUBIC};
    use super::super::model::Table;
    use super::super::normal::Normal;
    use super::super::rows::ClusterRows;
    use super::*;

    const CLUSTERS: usize = 9;
    const ROWS: usize = 40;
    /// Own and shared columns of a cluster.
    const LOCAL: usize = 2;
    const SHARED: usize = 3;

    fn clusters() -> Vec<(ClusterRows, Table)> {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut cluster = || {
            let jacobian = DMatrix::from_fn(ROWS, LOCAL + SHARED, |_, _| rng.random_range(-1.0..1.0));
            let residuals = DVector::from_fn(ROWS, |_, _| rng.random_range(-1.0..1.0));
            let normal = Normal { hessian: jacobian.tr_mul(&jacobian), gradient: jacobian.tr_mul(&residuals) };
            let covariates = DMatrix::from_fn(ROWS, 2, |_, _| rng.random_range(0.0..1.0));
            let weights = DMatrix::from_fn(ROWS, 2, |_, _| rng.random_range(0.5..2.0));
            (ClusterRows::new(&jacobian, &residuals, &normal, LOCAL).unwrap(), Table { covariates, weights })
        };
        (0..CLUSTERS).map(|_| cluster()).collect()
    }

    fn group(counts: &[(usize, usize)], weight: usize) -> Group {
        let axis = |count| Axis { low: 0.0, high: 1.0, count, degree: CUBIC };
        let axes = counts.iter().map(|(covariate, count)| (*covariate, axis(*count))).collect();
        Group { axes, weight, covariates: BTreeSet::from([weight]), words: String::new() }
    }

    /// The gain of sets of groups with a candidate is that of a model of these groups alone.
    #[test]
    fn gains_with_a_candidate_are_those_of_all_products() {
        let clusters = clusters();
        let model = |groups: Vec<Group>| Additive {
            clusters: clusters.iter().map(|(rows, table)| Cluster { rows, table: table.clone() }).collect(),
            groups,
            sequential: BTreeSet::new(),
        };
        let groups = vec![
            group(&[(0, 6)], 0),
            group(&[(0, 5), (1, 4)], 1),
            group(&[(1, 7)], 0),
            group(&[(1, 8), (0, 4)], 0),
            group(&[], 1),
            group(&[(0, 9)], 1),
        ];
        let whole = model(groups.clone());
        let products = CandidateProducts::of(&whole, &[1, 0, 2], &[3, 4, 5, 2]).unwrap();
        for (members, candidate) in
            [(vec![0, 1], Some(3)), (vec![2], Some(5)), (vec![1, 2, 0], Some(4)), (vec![], Some(3)), (vec![2, 1], None)]
        {
            let of_both = products.blocks(&members, candidate).unwrap();
            let alone = model(members.iter().chain(&candidate).map(|g| groups[*g].clone()).collect());
            let expected = Blocks::of(&alone).unwrap();
            let all: Vec<usize> = (0..alone.groups.len()).collect();
            assert_eq!(of_both.tested, expected.tested);
            for set in [&all[..], &all[1..]].into_iter().filter(|set| !set.is_empty()) {
                let [gain, expected] = [of_both.gain(set), expected.gain(set)];
                // Products are in single precision.
                assert!((gain - expected).abs() < 1e-4 * expected.abs().max(1.0), "{members:?} {gain} {expected}");
            }
        }
    }
}
