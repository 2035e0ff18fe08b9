//! The law of the pure error over depth, and how far it is correlated over the image, without a model of either.
//!
//! Residuals r of a frame f contain what frames share, s, and what they do not. With the mean m of all *other* frames in the same
//! cell, E[r²] − E[r m] is the variance of the rest, and E[r(p) r(p + h)] − E[r(p) m(p + h)] its covariance at the distance h: a
//! pattern that all frames have is in both terms, and noise in the first alone. Residuals are in standard deviations; where the
//! pattern is not the same in these at all depths, its part is exact on average over depths alone.

use depthcal_io::DiagnosisNoiseAtDepth;
use depthcal_statistics::nearest_rank;
use rayon::prelude::*;

use super::residual_cells::{Cells, Cover, LARGEST_SHARE};
use crate::calibrate::CalibratedCamera;
use crate::observe::depth_sampling::{LONGEST_PX, distance_of_the_sill};
use crate::observe::noise::{DepthNoise, fit_depth_noise};

/// Bins of equal counts over depth in each of which the shared part is estimated.
const BINS: usize = 8;
/// Quantiles of depth at which the standard deviation is stated.
const STATED: [f64; 3] = [0.05, 0.5, 0.95];
/// About so many residuals determine the law, and as many pairs of pixels the covariance at each distance.
const MOST_RESIDUALS: usize = 200_000;

/// The noise of depth that the pure error has.
#[derive(Debug, Clone, PartialEq)]
pub struct PureNoise {
    /// Its law over depth.
    pub law: DepthNoise,
    /// Its standard deviation at near, middle and far depths of the captures.
    pub at: [DiagnosisNoiseAtDepth; 3],
    /// Distance at which pixels are nearly uncorrelated, px; `None` where single pixels were captured instead of images.
    pub correlation_px: Option<usize>,
}

/// Sums of products of residuals in standard deviations, with the other frames' mean and with residuals of the own frame.
#[derive(Clone, Copy, Default)]
struct Products {
    own: f64,
    pairs: f64,
    with_others: f64,
    with_others_pairs: f64,
}

impl Products {
    fn add(&mut self, own: f64, with_others: Option<f64>) {
        self.own += own;
        self.pairs += 1.0;
        if let Some(product) = with_others {
            self.with_others += product;
            self.with_others_pairs += 1.0;
        }
    }

    fn merge(&mut self, other: &Self) {
        self.own += other.own;
        self.pairs += other.pairs;
        self.with_others += other.with_others;
        self.with_others_pairs += other.with_others_pairs;
    }

    /// Mean product of the own frame, and of it with the others.
    fn means(&self) -> [f64; 2] {
        [self.own / self.pairs.max(1.0), self.with_others / self.with_others_pairs.max(1.0)]
    }
}

/// Sums by bin of depth, and by distance in the image.
#[derive(Clone, Default)]
struct Sums {
    bins: [Products; BINS],
    distances: [Products; LONGEST_PX + 1],
}

/// Sum and number of values in every cell of a grid.
fn cell_sums(frame: &[Cells], cover: &Cover, size: [usize; 2]) -> Vec<(f32, f32)> {
    let mut sums = vec![(0.0, 0.0); size[0] * size[1]];
    for c in frame {
        let sum = &mut sums[index(cover, c, size)];
        *sum = (sum.0 + c.value, sum.1 + 1.0);
    }
    sums
}

fn index(cover: &Cover, cells: &Cells, size: [usize; 2]) -> usize {
    let [column, row] = (cover.place)(cells).map(usize::from);
    row * size[0] + column
}

/// The pure noise of frames' residuals that share something in the cells of `shared`, or nothing; `None` where they are too few.
pub(super) fn pure_noise(fit: &CalibratedCamera, frames: &[&[Cells]], shared: Option<&Cover>) -> Option<PureNoise> {
    let size = shared.map_or([0; 2], |cover| cover.size(frames.iter().copied()));
    let mut total = vec![(0.0_f32, 0.0_f32); size[0] * size[1]];
    for frame in frames {
        let of_frame = shared.map_or_else(Vec::new, |cover| cell_sums(frame, cover, size));
        total.iter_mut().zip(of_frame).for_each(|(t, f)| *t = (t.0 + f.0, t.1 + f.1));
    }
    let count: usize = frames.iter().map(|f| f.len()).sum();
    // Odd, so that no pattern of every second pixel is left out.
    let step = (count / MOST_RESIDUALS) | 1;
    let some = || frames.iter().copied().flatten().step_by(step);
    let mut depths: Vec<f64> = some().map(Cells::depth_mm).collect();
    depths.sort_by(f64::total_cmp);
    let edges: Vec<f64> = (1..BINS).filter_map(|bin| nearest_rank(&depths, bin as f64 / BINS as f64)).collect();
    let bin_of = |depth_mm: f64| edges.partition_point(|edge| *edge < depth_mm);
    let has_images = fit.capture.frames.iter().all(|f| f.raw.depth_pixels().is_empty());
    let sums = frames
        .par_iter()
        .map(|frame| {
            let frame_sums = shared.map_or_else(Vec::new, |cover| cell_sums(frame, cover, size));
            let others = |c: &Cells| {
                let cell = index(shared?, c, size);
                let (sum, n) = (total[cell].0 - frame_sums[cell].0, total[cell].1 - frame_sums[cell].1);
                (n > 0.5).then(|| f64::from(sum / n))
            };
            let mut sums = Sums::default();
            for c in frame.iter().step_by(step) {
                let value = f64::from(c.value);
                let products = (value * value, others(c).map(|mean| value * mean));
                sums.bins[bin_of(c.depth_mm())].add(products.0, products.1);
                sums.distances[0].add(products.0, products.1);
            }
            if has_images {
                add_distances(&mut sums, frame, step, others);
            }
            sums
        })
        .reduce(Sums::default, |mut a, b| {
            a.bins.iter_mut().zip(&b.bins).for_each(|(a, b)| a.merge(b));
            a.distances.iter_mut().zip(&b.distances).for_each(|(a, b)| a.merge(b));
            a
        });
    let pure_shares: Vec<f64> = sums
        .bins
        .iter()
        .map(|products| {
            let [variance, with_others] = products.means();
            1.0 - (with_others / variance).clamp(0.0, LARGEST_SHARE)
        })
        .collect();
    let residual = |c: &Cells| {
        let rho = 1.0 / c.depth_mm();
        (rho, f64::from(c.value) * fit.noise.depth.sigma(rho) * pure_shares[bin_of(c.depth_mm())].sqrt())
    };
    let law = fit_depth_noise(&some().map(residual).collect::<Vec<_>>(), 1.0)?;
    let stated = STATED.map(|q| {
        let depth_mm = nearest_rank(&depths, q).unwrap_or(f64::NAN);
        DiagnosisNoiseAtDepth { depth_mm, std_mm: law.sigma(1.0 / depth_mm) * depth_mm * depth_mm }
    });
    Some(PureNoise { law, at: stated, correlation_px: has_images.then(|| correlation_px(&sums.distances)) })
}

/// Adds the products of every `step`-th of a frame's pixels with those to the right of and below it.
fn add_distances(sums: &mut Sums, frame: &[Cells], step: usize, others: impl Fn(&Cells) -> Option<f64>) {
    let size = frame.iter().fold([0; 2], |s, c| [0, 1].map(|i| usize::max(s[i], usize::from(c.pixel[i]) + 1)));
    let columns = size[0] + LONGEST_PX;
    let mut at_pixel = vec![usize::MAX; columns * (size[1] + LONGEST_PX)];
    let place = |c: &Cells| usize::from(c.pixel[1]) * columns + usize::from(c.pixel[0]);
    frame.iter().enumerate().for_each(|(i, c)| at_pixel[place(c)] = i);
    for c in frame.iter().step_by(step) {
        let pixel = (f64::from(c.value), others(c));
        for (h, products) in sums.distances.iter_mut().enumerate().skip(1) {
            for next in [place(c) + h, place(c) + h * columns] {
                let Some(neighbour) = frame.get(at_pixel[next]) else { continue };
                let value = f64::from(neighbour.value);
                let with_others = others(neighbour).zip(pixel.1).map(|(a, b)| 0.5 * (pixel.0 * a + value * b));
                products.add(pixel.0 * value, with_others);
            }
        }
    }
}

/// The correlation length by the structure function C(0) − C(h), as where depth is sampled.
fn correlation_px(distances: &[Products; LONGEST_PX + 1]) -> usize {
    let covariance = distances.map(|products| {
        let [product, with_others] = products.means();
        product - with_others
    });
    distance_of_the_sill(|h| covariance[0] - covariance[h])
}
