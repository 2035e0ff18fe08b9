//! Chessboards by their saddle points, for boards that OpenCV's detector misses: small squares, little or no white
//! border around the outer squares, steep views. The saddle points of the smoothed image are the candidates over which
//! a lattice is grown; the board is then found in the lattice, as with circle grids.

use std::collections::BTreeMap;

use depthcal_model::target::Target;

use crate::geometry::BoardMap;
use crate::lattice::blob::Blob;
use crate::lattice::labelling::{board_cells, labellings};
use crate::lattice::neighbourhood::Neighbourhood;
use crate::stretch::Plane;

/// Number of candidates, the strongest ones.
const MAX_SADDLES: usize = 1200;
/// Number of candidates from which a lattice is grown.
const MAX_SEEDS: usize = 400;
/// Number of candidates from which a part of a board is grown; a part that is large enough has several of them.
const MAX_LATTICE_SEEDS: usize = 120;
/// Weakest response relative to that at the strongest tenth. The response is proportional to the square of the
/// contrast.
const WEAKEST: f32 = 0.02;
/// Radius of the ring on which a crossing is checked, px.
const RING_PX: f64 = 3.0;
/// Largest mean difference between opposite points of the ring, relative to the range of its grey values.
const MAX_ASYMMETRY: f32 = 0.4;
/// Standard deviations of the smoothing, px; blurred images and large squares need the second.
const SMOOTHING: [f32; 2] = [1.0, 2.0];

/// All corners of the board (px, to a fraction of a pixel), in the order of one of its labellings. Hidden corners are
/// interpolated.
pub(crate) fn find(plane: &Plane, target: &Target) -> Option<Vec<[f64; 2]>> {
    let board = board_cells(target);
    SMOOTHING.iter().find_map(|&sigma| {
        let saddles = saddles(&smoothed(plane, sigma));
        let hood = Neighbourhood::new(&saddles, plane.width);
        (0..saddles.len().min(MAX_SEEDS)).find_map(|seed| {
            hood.bases_of_point(seed).into_iter().find_map(|basis| {
                let lattice = hood.grow(seed, basis);
                let places = labellings(&lattice, &board).into_iter().next()?;
                let seen: Vec<_> = places
                    .iter()
                    .enumerate()
                    .filter_map(|(index, place)| Some((target.point(index), saddles[*lattice.get(place)?].center)))
                    .collect();
                // A hidden corner takes its position from the others.
                let map = BoardMap::fit(&seen)?;
                places
                    .iter()
                    .enumerate()
                    .map(|(index, place)| match lattice.get(place) {
                        Some(&saddle) => Some(saddles[saddle].center),
                        None => map.apply(target.point(index)),
                    })
                    .collect()
            })
        })
    })
}

/// Lattices of at least `least` crossings, grown over the saddle points of the image smoothed by `sigma` px. Nodes are in
/// px, in a basis that is right-handed in the image. Bright and dark change places from each node to the next, which tells
/// the lattice of a chessboard from the one along its diagonals.
pub(crate) fn lattices(plane: &Plane, sigma: f32, least: usize) -> impl Iterator<Item = BTreeMap<[i32; 2], [f64; 2]>> {
    let smooth = smoothed(plane, sigma);
    let saddles = saddles(&smooth);
    let angles: Vec<f64> = saddles.iter().map(|s| bright_angle(&smooth, s.center)).collect();
    let width = plane.width;
    // A seed that a lattice has contained would give the same one again.
    let mut used = vec![false; saddles.len()];
    (0..saddles.len().min(MAX_LATTICE_SEEDS)).filter_map(move |seed| {
        if used[seed] {
            return None;
        }
        let alternate = |a: usize, b: usize| (2.0 * (angles[a] - angles[b])).cos() < -0.4;
        let hood = Neighbourhood::new(&saddles, width);
        let grown = hood
            .bases_of_point(seed)
            .into_iter()
            .filter(|basis| basis.iter().all(|&b| alternate(seed, b)))
            .map(|basis| hood.grow(seed, basis))
            .filter(|lattice| lattice.len() >= least)
            .filter(|lattice| {
                let steps = lattice.iter().flat_map(|(&[x, y], &i)| [([x + 1, y], i), ([x, y + 1], i)]);
                let pairs: Vec<bool> =
                    steps.filter_map(|(next, i)| lattice.get(&next).map(|&j| alternate(i, j))).collect();
                10 * pairs.iter().filter(|p| **p).count() >= 8 * pairs.len()
            })
            .max_by_key(|lattice| lattice.len())?;
        grown.values().for_each(|&i| used[i] = true);
        Some(grown.into_iter().map(|(cell, i)| (cell, saddles[i].center)).collect())
    })
}

/// Direction in which the image is brighter on both sides of a saddle point, rad, modulo π.
fn bright_angle(plane: &Plane, center: [f64; 2]) -> f64 {
    let (x, y) = (center[0].round() as usize, center[1].round() as usize);
    let grey =
        |x: usize, y: usize| f64::from(plane.data[y.min(plane.height - 1) * plane.width + x.min(plane.width - 1)]);
    let (left, above) = (x.saturating_sub(1), y.saturating_sub(1));
    let xx = grey(x + 1, y) - 2.0 * grey(x, y) + grey(left, y);
    let yy = grey(x, y + 1) - 2.0 * grey(x, y) + grey(x, above);
    let xy = (grey(x + 1, y + 1) - grey(left, y + 1) - grey(x + 1, above) + grey(left, above)) / 4.0;
    (2.0 * xy).atan2(xx - yy) / 2.0
}

/// Local maxima of minus the determinant of the Hessian that are crossings, the strongest first.
fn saddles(plane: &Plane) -> Vec<Blob> {
    let (width, height) = (plane.width, plane.height);
    if width < 8 || height < 8 {
        return Vec::new();
    }
    let grey = |x: usize, y: usize| plane.data[y * width + x];
    let hessian = |x: usize, y: usize| {
        let xx = grey(x + 1, y) - 2.0 * grey(x, y) + grey(x - 1, y);
        let yy = grey(x, y + 1) - 2.0 * grey(x, y) + grey(x, y - 1);
        let xy = (grey(x + 1, y + 1) - grey(x - 1, y + 1) - grey(x + 1, y - 1) + grey(x - 1, y - 1)) / 4.0;
        [xx, xy, yy]
    };
    let mut response = vec![0.0f32; width * height];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let [xx, xy, yy] = hessian(x, y);
            response[y * width + x] = (xy * xy - xx * yy).max(0.0);
        }
    }
    let mut peaks: Vec<(f32, usize, usize)> = Vec::new();
    for y in 3..height - 3 {
        for x in 3..width - 3 {
            let value = response[y * width + x];
            let rivals = (y - 2..=y + 2).flat_map(|v| (x - 2..=x + 2).map(move |u| v * width + u));
            let index = y * width + x;
            // Of equal values the first counts.
            if value > 0.0
                && rivals.filter(|&r| r != index).all(|r| response[r] < value || (response[r] == value && r > index))
            {
                peaks.push((value, x, y));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)).then(a.1.cmp(&b.1)));
    peaks.truncate(MAX_SADDLES);
    let weakest = peaks.get(peaks.len() / 10).map_or(0.0, |p| WEAKEST * p.0);
    peaks
        .into_iter()
        .filter(|p| p.0 > weakest && is_crossing(plane, p.1, p.2))
        .map(|(_, x, y)| {
            // To sub-pixel accuracy: where the gradient vanishes.
            let [xx, xy, yy] = hessian(x, y);
            let (gx, gy) = ((grey(x + 1, y) - grey(x - 1, y)) / 2.0, (grey(x, y + 1) - grey(x, y - 1)) / 2.0);
            let determinant = xx * yy - xy * xy;
            let offset = [(xy * gy - yy * gx) / determinant, (xy * gx - xx * gy) / determinant];
            let [dx, dy] = offset.map(|d| f64::from(d.clamp(-1.0, 1.0)));
            Blob { center: [x as f64 + dx, y as f64 + dy], covariance: [0.25, 0.0, 0.25], area: 1.0, contrast: 0 }
        })
        .collect()
}

/// Whether dark and bright alternate twice around a point and opposite sides are alike. This excludes the outer corners
/// of a board's dark squares, which also lie on the lattice.
fn is_crossing(plane: &Plane, x: usize, y: usize) -> bool {
    const AROUND: usize = 16;
    let ring: [f32; AROUND] = std::array::from_fn(|i| {
        let (sin, cos) = (i as f64 * std::f64::consts::TAU / AROUND as f64).sin_cos();
        let (u, v) = (x as f64 + RING_PX * cos, y as f64 + RING_PX * sin);
        let inside = |w: f64, size: usize| w.round().clamp(0.0, size as f64 - 1.0) as usize;
        plane.data[inside(v, plane.height) * plane.width + inside(u, plane.width)]
    });
    let (low, high) = ring.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let middle = (low + high) / 2.0;
    let changes = (0..AROUND).filter(|&i| (ring[i] > middle) != (ring[(i + 1) % AROUND] > middle)).count();
    let asymmetry: f32 = (0..AROUND / 2).map(|i| (ring[i] - ring[i + AROUND / 2]).abs()).sum();
    changes == 4 && asymmetry < MAX_ASYMMETRY * (high - low) * (AROUND / 2) as f32
}

/// The plane smoothed by a Gaussian of standard deviation `sigma` px.
fn smoothed(plane: &Plane, sigma: f32) -> Plane {
    let radius = (3.0 * sigma).ceil() as isize;
    let kernel: Vec<f32> = (-radius..=radius).map(|i| (-((i * i) as f32) / (2.0 * sigma * sigma)).exp()).collect();
    let total: f32 = kernel.iter().sum();
    let (width, height) = (plane.width as isize, plane.height as isize);
    let pass = |input: &[f32], dx: isize, dy: isize| -> Vec<f32> {
        (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let sum: f32 = (-radius..=radius)
                    .zip(&kernel)
                    .map(|(i, k)| {
                        let (u, v) = ((x + i * dx).clamp(0, width - 1), (y + i * dy).clamp(0, height - 1));
                        k * input[(v * width + u) as usize]
                    })
                    .sum();
                sum / total
            })
            .collect()
    };
    let data = pass(&pass(&plane.data, 1, 0), 0, 1);
    Plane { width: plane.width, height: plane.height, data }
}
