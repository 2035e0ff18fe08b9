//! Growing a lattice over candidates.
//!
//! A candidate and two of its neighbours propose a basis. From there every further node is predicted from the nodes
//! nearby, and accepted when a candidate of similar size lies there. The prediction is local and affine, so perspective
//! and lens hardly matter. A dot's elliptical shape gives the metric in which its neighbours are chosen, which undoes
//! the tilt of the board.

use std::collections::BTreeMap;

use super::blob::Blob;

/// Largest distance of a candidate from its predicted position, in steps of the lattice.
const TOLERANCE: f64 = 0.28;
/// Largest ratio of the areas of neighbouring candidates.
const AREA_RATIO: f64 = 2.2;

/// Index of the candidate at every node. Nodes have integer coordinates in a basis that is right-handed in the image
/// (x right, y down).
pub(crate) type Lattice = BTreeMap<[i32; 2], usize>;

/// Candidates sorted into square buckets, so that neighbours are found without a search of all.
pub(crate) struct Neighbourhood<'a> {
    blobs: &'a [Blob],
    cell: f64,
    columns: i64,
    buckets: BTreeMap<i64, Vec<usize>>,
}

impl<'a> Neighbourhood<'a> {
    pub(crate) fn new(blobs: &'a [Blob], width: usize) -> Neighbourhood<'a> {
        let cell = 24.0;
        let columns = (width as f64 / cell) as i64 + 3;
        let mut hood = Neighbourhood { blobs, cell, columns, buckets: BTreeMap::new() };
        for (i, blob) in blobs.iter().enumerate() {
            let key = hood.key(blob.center);
            hood.buckets.entry(key).or_default().push(i);
        }
        hood
    }

    fn key(&self, p: [f64; 2]) -> i64 {
        (p[1] / self.cell) as i64 * self.columns + (p[0] / self.cell) as i64
    }

    /// Candidates within `radius` of `p` (px), in a fixed order.
    fn within(&self, p: [f64; 2], radius: f64) -> Vec<usize> {
        let range = |v: f64| ((((v - radius) / self.cell).floor() as i64).max(0), ((v + radius) / self.cell) as i64);
        let ((x0, x1), (y0, y1)) = (range(p[0]), range(p[1]));
        let mut near = Vec::new();
        for y in y0..=y1 {
            for x in x0..=x1.min(self.columns - 1) {
                let Some(bucket) = self.buckets.get(&(y * self.columns + x)) else { continue };
                near.extend(bucket.iter().copied().filter(|&i| {
                    let c = self.blobs[i].center;
                    (c[0] - p[0]).hypot(c[1] - p[1]) <= radius
                }));
            }
        }
        near
    }

    /// The candidate nearest to `p`, if there is one within `radius` (px).
    fn nearest(&self, p: [f64; 2], radius: f64) -> Option<usize> {
        let distance = |i: usize| (self.blobs[i].center[0] - p[0]).hypot(self.blobs[i].center[1] - p[1]);
        self.within(p, radius).into_iter().min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    }

    /// Pairs of neighbours of the dot `seed` that may span the basis, the shortest first. `step_in_radii` is the
    /// printed lattice step over the printed radius.
    pub(crate) fn bases(&self, seed: usize, step_in_radii: f64) -> Vec<[usize; 2]> {
        let blob = &self.blobs[seed];
        let [xx, _, yy] = blob.covariance;
        let reach = 2.0 * (xx + yy).sqrt() * step_in_radii * 1.5;
        let mut arms: Vec<(usize, [f64; 2], f64)> = self
            .within(blob.center, reach)
            .into_iter()
            .filter(|&i| i != seed && similar(blob, &self.blobs[i]))
            .map(|i| {
                let d = subtract(self.blobs[i].center, blob.center);
                (i, d, blob.in_radii(d))
            })
            .filter(|(_, _, length)| (0.6..1.5).contains(&(length / step_in_radii)))
            .collect();
        arms.sort_by(|a, b| a.2.total_cmp(&b.2));
        arms.truncate(8);
        let mut pairs = Vec::new();
        for (i, a) in arms.iter().enumerate() {
            for b in &arms[i + 1..] {
                let cosine = blob.dot_product(a.1, b.1) / (a.2 * b.2);
                if cosine.abs() < 0.6 && b.2 / a.2 < 1.4 {
                    let right_handed = a.1[0] * b.1[1] - a.1[1] * b.1[0] > 0.0;
                    pairs.push((a.2 + b.2, if right_handed { [a.0, b.0] } else { [b.0, a.0] }));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs.into_iter().map(|p| p.1).take(8).collect()
    }

    /// Pairs of neighbours of a point without shape that may span the basis, the shortest first.
    pub(crate) fn bases_of_point(&self, seed: usize) -> Vec<[usize; 2]> {
        let center = self.blobs[seed].center;
        let mut radius = 16.0;
        let mut near = self.within(center, radius);
        while near.len() < 7 && radius < 400.0 {
            radius *= 2.0;
            near = self.within(center, radius);
        }
        let mut arms: Vec<(usize, [f64; 2], f64)> = near
            .into_iter()
            .filter(|&i| i != seed)
            .map(|i| {
                let d = subtract(self.blobs[i].center, center);
                (i, d, d[0].hypot(d[1]))
            })
            .collect();
        arms.sort_by(|a, b| a.2.total_cmp(&b.2));
        arms.truncate(7);
        let mut pairs = Vec::new();
        for (i, a) in arms.iter().enumerate() {
            for b in &arms[i + 1..] {
                let cross = a.1[0] * b.1[1] - a.1[1] * b.1[0];
                if cross.abs() > 0.5 * a.2 * b.2 && b.2 / a.2 < 2.2 {
                    pairs.push((a.2 + b.2, if cross > 0.0 { [a.0, b.0] } else { [b.0, a.0] }));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs.into_iter().map(|p| p.1).take(5).collect()
    }

    /// Grows the lattice spanned by a seed and its two neighbours as far as candidates are found.
    pub(crate) fn grow(&self, seed: usize, basis: [usize; 2]) -> Lattice {
        let mut lattice = Lattice::from([([0, 0], seed), ([1, 0], basis[0]), ([0, 1], basis[1])]);
        let mut used = vec![false; self.blobs.len()];
        for &i in lattice.values() {
            used[i] = true;
        }
        loop {
            // Nodes with most neighbours first: they are predicted best, and once accepted they support the others.
            let mut frontier: BTreeMap<[i32; 2], usize> = BTreeMap::new();
            for cell in lattice.keys() {
                for step in [[1, 0], [-1, 0], [0, 1], [0, -1]] {
                    let place = [cell[0] + step[0], cell[1] + step[1]];
                    if !lattice.contains_key(&place) {
                        *frontier.entry(place).or_default() += 1;
                    }
                }
            }
            let mut places: Vec<([i32; 2], usize)> = frontier.into_iter().collect();
            places.sort_by_key(|(place, support)| (std::cmp::Reverse(*support), *place));
            let before = lattice.len();
            for (place, _) in places {
                let Some((predicted, step)) = self.predict(&lattice, place) else { continue };
                let Some(nearest) = self.nearest(predicted, TOLERANCE * step) else { continue };
                let neighbour = [[1, 0], [-1, 0], [0, 1], [0, -1]]
                    .iter()
                    .find_map(|s| lattice.get(&[place[0] + s[0], place[1] + s[1]]).copied());
                if !used[nearest] && neighbour.is_some_and(|n| similar(&self.blobs[n], &self.blobs[nearest])) {
                    used[nearest] = true;
                    lattice.insert(place, nearest);
                }
            }
            if lattice.len() == before {
                return lattice;
            }
        }
    }

    /// Position of a node (px) by an affine fit to the nodes around it, and the length of the shorter step there (px).
    fn predict(&self, lattice: &Lattice, place: [i32; 2]) -> Option<([f64; 2], f64)> {
        let mut normal = nalgebra::Matrix3::zeros();
        let mut right = nalgebra::Matrix3x2::zeros();
        for dj in -2..=2 {
            for di in -2..=2 {
                let Some(&blob) = lattice.get(&[place[0] + di, place[1] + dj]) else { continue };
                let t = nalgebra::Vector3::new(1.0, f64::from(di), f64::from(dj));
                let weight = 1.0 / f64::from(di * di + dj * dj);
                let center = self.blobs[blob].center;
                normal += t * t.transpose() * weight;
                right += t * nalgebra::RowVector2::new(center[0], center[1]) * weight;
            }
        }
        // Nodes of a single row do not determine where the next row is.
        if normal.determinant() < 1e-6 {
            return None;
        }
        let solution = normal.cholesky()?.solve(&right);
        if !solution.iter().all(|v| v.is_finite()) {
            return None;
        }
        let step = |row: usize| solution[(row, 0)].hypot(solution[(row, 1)]);
        Some(([solution[(0, 0)], solution[(0, 1)]], step(1).min(step(2))))
    }
}

fn similar(a: &Blob, b: &Blob) -> bool {
    (1.0 / AREA_RATIO..AREA_RATIO).contains(&(a.area / b.area))
}

fn subtract(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}
