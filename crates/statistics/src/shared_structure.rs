//! Structure that several groups of values share at the same places: the covariance between groups, scale by scale.
//!
//! Noise is what groups do *not* share. Where the values of two groups at the same place are correlated, something depends on
//! the place, however small it is and whatever its form; no model of the noise is needed to see it. This is the estimate of
//! pure error from repeated measurements (Draper, Smith 1998, section 2.1), at places that repeat, with the values divided
//! into octaves of scale, so that a coarse error does not hide a fine one (Haar 1910).
//!
//! For one octave, with m the details of groups f and g at the cells c,
//!
//! ```text
//! G_fg = Σ_c m_fc m_gc,   T = Σ_{f<g} G_fg,   z = T / (Σ_{f<g} G_fg²)^½.
//! ```
//!
//! Where groups share nothing, the sign of a whole group is arbitrary: T under random signs is the distribution of T by
//! chance, however values within a group are correlated (a sign-flip test of clusters; Canay, Romano, Shaikh 2017). Where few
//! groups have cells in common that leaves little to tell chance by. Details far apart within a group are hardly
//! correlated, since larger scales are taken off: with a sign for each block of cells of a group the same test is sharper, and
//! the first one need only not contradict it.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::tails::gamma_tail;

/// Random signs of all groups by which p-values are corrected for the number of tests.
const DRAWS: usize = 2000;
/// Seed of these signs: the same input gives the same result.
const SEED: u64 = 5;
/// Side of a block, in cells of the scale.
const BLOCK: usize = 16;
/// Probability by chance, a sign for each group, from which on the sharper test counts as contradicted.
const CONTRADICTED: f64 = 0.05;
/// Fewest groups that can share anything beyond chance.
const FEWEST_GROUPS: usize = 6;

/// A value and the cell of the finest grid that it lies in, column and row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedValue {
    /// Column and row of the cell, from 0.
    pub cell: [u32; 2],
    /// The value.
    pub value: f64,
}

/// Structure that groups share at one scale.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedOctave {
    /// Side of the cells, in cells of the finest grid: 1, 2, 4, …; the details are those of cells of this side within cells of
    /// twice the side, and at the largest scale the cells themselves.
    pub side: u32,
    /// T in standard deviations of what it is by chance, a sign for each block of a group.
    pub z: f64,
    /// Probability of a T as large by chance, a sign for each block of a group.
    pub p_of_blocks: f64,
    /// Probability of a T as large by chance, a sign for each group.
    pub p_of_groups: f64,
    /// Estimated variance of what is shared at this scale, in squares of the values' unit, weighted by numbers of values;
    /// negative by chance.
    pub variance: f64,
    /// G, by rows; zero on the diagonal.
    products: Vec<f64>,
    /// Skewness of T by chance.
    skewness: f64,
}

/// Details of one group at one scale.
struct Level {
    /// Columns and rows of the grid.
    size: [usize; 2],
    /// (cell, detail · √n, √n) of the cells with values, n their number, by cell.
    cells: Vec<(u32, f32, f32)>,
}

/// Sums and numbers of values on a grid.
struct Grid {
    size: [usize; 2],
    sums: Vec<(f64, u32)>,
}

impl Grid {
    fn of(values: impl Iterator<Item = PlacedValue>, size: [usize; 2]) -> Self {
        let mut sums = vec![(0.0, 0); size[0] * size[1]];
        for v in values {
            let [column, row] = v.cell.map(|c| c as usize);
            if column < size[0] && row < size[1] && v.value.is_finite() {
                let cell = &mut sums[row * size[0] + column];
                *cell = (cell.0 + v.value, cell.1 + 1);
            }
        }
        Self { size, sums }
    }

    /// Details at every scale from the finest.
    fn pyramid(mut self) -> Vec<Level> {
        let mut all = Vec::new();
        loop {
            let coarser = self.size.iter().any(|n| *n > 2).then(|| self.coarser());
            all.push(Level { size: self.size, cells: self.details(coarser.as_ref()) });
            match coarser {
                Some(coarser) => self = coarser,
                None => return all,
            }
        }
    }

    /// The grid of cells of twice the side.
    fn coarser(&self) -> Self {
        let size = self.size.map(|n| n.div_ceil(2));
        let mut sums = vec![(0.0, 0); size[0] * size[1]];
        for (row, line) in self.sums.chunks_exact(self.size[0]).enumerate() {
            for (column, (sum, n)) in line.iter().enumerate() {
                let cell = &mut sums[row / 2 * size[0] + column / 2];
                *cell = (cell.0 + sum, cell.1 + n);
            }
        }
        Self { size, sums }
    }

    /// Means of cells less those of the cells of `coarser` around them; the means themselves without it.
    fn details(&self, coarser: Option<&Self>) -> Vec<(u32, f32, f32)> {
        let mut cells = Vec::new();
        for (i, (sum, n)) in self.sums.iter().enumerate().filter(|(_, (_, n))| *n > 0) {
            let around = coarser.map_or(0.0, |c| {
                let (row, column) = (i / self.size[0], i % self.size[0]);
                let (sum, n) = c.sums[row / 2 * c.size[0] + column / 2];
                sum / f64::from(n)
            });
            let root = f64::from(*n).sqrt();
            cells.push((i as u32, ((sum / f64::from(*n) - around) * root) as f32, root as f32));
        }
        cells
    }
}

/// Structure that groups of values share at the same cells of a grid of `size` columns and rows, octave by octave from the
/// finest; empty with fewer than six groups. `values` has those of a group, given its number.
pub fn shared_structure<V>(groups: usize, size: [usize; 2], values: impl Fn(usize) -> V) -> Vec<SharedOctave>
where
    V: Iterator<Item = PlacedValue>,
{
    if groups < FEWEST_GROUPS || size.contains(&0) {
        return Vec::new();
    }
    let mut pyramids: Vec<_> = (0..groups).map(|g| Grid::of(values(g), size).pyramid().into_iter()).collect();
    let mut octaves = Vec::new();
    let mut side = 1;
    loop {
        let level: Vec<Level> = pyramids.iter_mut().filter_map(Iterator::next).collect();
        if level.is_empty() {
            return octaves;
        }
        octaves.extend(octave(&level, side));
        side *= 2;
    }
}

/// T of one scale; `None` where no two groups have values in the same cell.
fn octave(level: &[Level], side: u32) -> Option<SharedOctave> {
    let groups = level.len();
    let size = level[0].size;
    let across = size[0].div_ceil(BLOCK);
    let block_of = |cell: u32| cell as usize / size[0] / BLOCK * across + cell as usize % size[0] / BLOCK;
    let blocks = across * size[1].div_ceil(BLOCK);
    // G of every block, symmetric.
    let mut products = vec![0.0_f32; blocks * groups * groups];
    let mut weights = 0.0;
    let mut dense = vec![(0.0_f32, 0.0_f32); size[0] * size[1]];
    for f in 0..groups {
        for (cell, detail, root) in &level[f].cells {
            dense[*cell as usize] = (*detail, *root);
        }
        for g in f + 1..groups {
            for (cell, detail, root) in &level[g].cells {
                let entry = dense[*cell as usize];
                if entry.1 > 0.0 {
                    products[(block_of(*cell) * groups + f) * groups + g] += entry.0 * detail;
                    weights += f64::from(entry.1 * root);
                }
            }
        }
        for (cell, ..) in &level[f].cells {
            dense[*cell as usize] = (0.0, 0.0);
        }
    }
    let (mut whole, mut variance, mut third) = (vec![0.0; groups * groups], 0.0, 0.0);
    for block in products.chunks_exact(groups * groups) {
        let block = symmetric(block, groups);
        whole.iter_mut().zip(&block).for_each(|(w, b)| *w += b);
        variance += half_squares(&block);
        third += trace_of_cube(&block, groups);
    }
    let total = 0.5 * whole.iter().sum::<f64>();
    let of_groups = half_squares(&whole);
    if weights == 0.0 || variance == 0.0 || of_groups == 0.0 {
        return None;
    }
    let z = total / variance.sqrt();
    let skewness = trace_of_cube(&whole, groups) / of_groups.powf(1.5);
    Some(SharedOctave {
        side,
        z,
        p_of_blocks: gamma_tail(z, third / variance.powf(1.5)),
        p_of_groups: gamma_tail(total / of_groups.sqrt(), skewness),
        variance: total / weights,
        products: whole,
        skewness,
    })
}

/// The upper triangle of a matrix, mirrored.
fn symmetric(upper: &[f32], n: usize) -> Vec<f64> {
    (0..n * n).map(|i| f64::from(upper[(i / n).min(i % n) * n + (i / n).max(i % n)])).collect()
}

/// Variance of T under random signs: Σ_{f<g} G_fg².
fn half_squares(g: &[f64]) -> f64 {
    0.5 * g.iter().map(|p| p * p).sum::<f64>()
}

/// Third moment of T under random signs: tr G³, six times the sum over triples of groups of the product of their three G.
fn trace_of_cube(g: &[f64], n: usize) -> f64 {
    let seen: Vec<usize> = (0..n).filter(|i| g[i * n..(i + 1) * n].iter().any(|p| *p != 0.0)).collect();
    let mut sum = 0.0;
    for (a, &i) in seen.iter().enumerate() {
        for &k in &seen[..a] {
            let product = g[i * n + k];
            if product != 0.0 {
                // Σ_l G_il G_kl over all l: G is symmetric with a zero diagonal.
                sum += 2.0 * product * seen.iter().map(|&l| g[i * n + l] * g[k * n + l]).sum::<f64>();
            }
        }
    }
    sum
}

/// Random signs of so many groups, draw by draw.
fn draws(groups: usize) -> impl Iterator<Item = Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    (0..DRAWS).map(move |_| (0..groups).map(|_| if rng.random::<bool>() { 1.0 } else { -1.0 }).collect())
}

/// 2 T of groups with these signs.
fn twice_total(products: &[f64], signs: &[f64]) -> f64 {
    let rows = products.chunks_exact(signs.len()).zip(signs);
    rows.map(|(row, s)| s * row.iter().zip(signs).map(|(p, s)| p * s).sum::<f64>()).sum()
}

/// p-values of tests on the same groups, corrected for their number.
///
/// A sign for each group: the share of random signs with which any of the tests has a p-value as small (Westfall, Young 1993), so
/// that tests that say nearly the same count as nearly one. A sign for each block: the p-value times the number of tests, where
/// the test by groups does not contradict it. The smaller of the two counts, doubled for the choice.
pub fn family_p_values(tests: &[SharedOctave]) -> Vec<f64> {
    let Some(first) = tests.first() else { return Vec::new() };
    let groups = first.products.len().isqrt();
    // 2 T is compared.
    let scales: Vec<f64> = tests.iter().map(|t| 2.0 * half_squares(&t.products).sqrt()).collect();
    let smallest: Vec<f64> = draws(groups)
        .map(|signs| {
            let p_value =
                |(t, scale): (&SharedOctave, &f64)| gamma_tail(twice_total(&t.products, &signs) / scale, t.skewness);
            tests.iter().zip(&scales).map(p_value).fold(1.0, f64::min)
        })
        .collect();
    let corrected = |t: &SharedOctave| {
        let as_small = smallest.iter().filter(|p| **p <= t.p_of_groups * (1.0 + 1e-9)).count();
        // The signs as they are count as one draw.
        let of_groups = (as_small + 1) as f64 / (DRAWS + 1) as f64;
        let of_blocks = if t.p_of_groups < CONTRADICTED { t.p_of_blocks * tests.len() as f64 } else { 1.0 };
        (2.0 * of_groups.min(of_blocks)).min(1.0)
    };
    tests.iter().map(corrected).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, StandardNormal};

    /// Groups of noise of standard deviation 1 with a plane of each group's own, and a pattern at some scale.
    fn groups(count: usize, seed: u64, pattern: impl Fn([u32; 2]) -> f64) -> Vec<Vec<PlacedValue>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
        (0..count)
            .map(|_| {
                let plane = [2.0 * normal(), normal() / 10.0, normal() / 10.0];
                (0..40 * 30)
                    .map(|i| [i % 40, i / 40])
                    .map(|cell: [u32; 2]| {
                        let [u, v] = cell.map(f64::from);
                        let value = normal() + plane[0] + plane[1] * (u - 20.0) + plane[2] * (v - 15.0) + pattern(cell);
                        PlacedValue { cell, value }
                    })
                    .collect()
            })
            .collect()
    }

    fn shared(groups: &[Vec<PlacedValue>], size: [usize; 2]) -> Vec<SharedOctave> {
        shared_structure(groups.len(), size, |g| groups[g].iter().copied())
    }

    /// Of 60 repeats with six scales and two tests each, 7.2 are expected below 1 %.
    #[test]
    fn what_no_groups_share_is_chance() {
        let octaves = (0..60).flat_map(|seed| shared(&groups(12, seed, |_| 0.0), [40, 30]));
        let values: Vec<f64> = octaves.flat_map(|o| [o.p_of_groups, o.p_of_blocks]).collect();
        let below = |level: f64| values.iter().filter(|p| **p < level).count();
        assert!(below(0.01) <= 20, "{} of {} below 1 %", below(0.01), values.len());
        assert!(below(1e-4) == 0);
        let half = below(0.5) as f64 / values.len() as f64;
        assert!((0.4..0.65).contains(&half), "{half}");
    }

    /// A pattern is seen at its own scale, with its variance, below planes that are many times as large.
    #[test]
    fn a_pattern_is_seen_at_its_scale() {
        for (period, side) in [(2, 1), (4, 2), (8, 4)] {
            let pattern =
                |[u, v]: [u32; 2]| if (u % period < period / 2) ^ (v % period < period / 2) { 0.3 } else { -0.3 };
            let octaves = shared(&groups(12, 7, pattern), [40, 30]);
            let best = octaves.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
            assert_eq!(best.side, side, "{octaves:?}");
            // 12 groups: all signs agree by chance in one of 2048 cases.
            assert!(best.p_of_groups < 1e-3 && best.p_of_blocks < 1e-3, "{best:?}");
            assert!((best.variance / 0.09 - 1.0).abs() < 0.15, "{best:?}");
        }
    }

    /// Corrected for their number, p-values of one family are below 5 % in 5 % of the families: 3 of 60 expected.
    #[test]
    fn families_of_tests_are_corrected() {
        let least = |seed| {
            let groups = groups(10, seed, |_| 0.0);
            let folded = |size: [u32; 2]| -> Vec<Vec<PlacedValue>> {
                let cell = |c: [u32; 2]| [c[0] % size[0], c[1] % size[1]];
                groups.iter().map(|g| g.iter().map(|v| PlacedValue { cell: cell(v.cell), ..*v }).collect()).collect()
            };
            let tests: Vec<SharedOctave> = [[40, 30], [40, 1], [1, 30]]
                .into_iter()
                .flat_map(|s| shared(&folded(s), s.map(|n| n as usize)))
                .collect();
            family_p_values(&tests).into_iter().fold(1.0, f64::min)
        };
        let small = (100..160).filter(|seed| least(*seed) < 0.05).count();
        assert!(small <= 8, "{small} of 60");
        let pattern = shared(&groups(10, 1, |[u, _]| f64::from(u % 2)), [40, 30]);
        assert!(family_p_values(&pattern).iter().any(|p| *p < 0.01));
        assert!(family_p_values(&[]).is_empty());
    }

    #[test]
    fn too_few_groups_say_nothing() {
        assert!(shared(&groups(5, 1, |_| 1.0), [40, 30]).is_empty());
        let apart: Vec<Vec<PlacedValue>> = (0..8).map(|i| vec![PlacedValue { cell: [i * 4, 0], value: 1.0 }]).collect();
        assert!(shared(&apart, [40, 1]).iter().all(|o| o.side > 2), "no cell in common");
    }
}
