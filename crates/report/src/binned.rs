//! Errors in bins: every frame contributes its median; the scatter of the medians is the uncertainty.

use super::pool::Pool;
use super::statistics::sign_generator;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_statistics::{median, student_quantile};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;

/// Fewest pixels of a frame in a bin.
const FEWEST_PIXELS: usize = 4;
/// Fewest frames of an interval.
const FEWEST_FRAMES: usize = 3;
/// Random sign patterns of a test.
const FLIPS: usize = 1999;

/// A frame's median in a cell.
#[derive(Debug, Clone, Copy)]
struct Median {
    cell: usize,
    value: f64,
    pixels: usize,
}

/// The error in one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Mean of the frames' medians; NaN of an empty cell.
    pub value: f64,
    /// Half the width of its 95 % interval, from the scatter of the frames' medians; NaN below [`FEWEST_FRAMES`] frames.
    pub half: f64,
    /// Frames that contribute.
    pub frames: usize,
    /// Their pixels.
    pub pixels: usize,
}

impl Cell {
    /// Whether its interval does not contain zero.
    pub(super) fn stands_out(&self) -> bool {
        self.value.abs() > self.half
    }
}

/// Medians of frames in cells.
#[derive(Debug, Clone)]
pub(super) struct Binned {
    cells: usize,
    frames: Vec<Vec<Median>>,
    /// Variance of a pixel's noise in each frame, mm².
    variances: Vec<f64>,
}

/// The outcome of a test for a systematic error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Structure {
    /// Probability of a pattern of this size if the sign of each frame's errors were random.
    pub p_value: f64,
    /// Root mean square of the smooth pattern, less what chance gives, mm; 0 where chance gives as much.
    pub size_mm: f64,
    /// Detection limit, mm rms: 95 % of the patterns by chance are smaller.
    pub hidden_mm: f64,
}

impl Binned {
    /// Bins the pixels of a pool. `cell` gives the cell of a pixel, `value` its error, `sigma` the noise of a pixel
    /// (mm).
    pub(super) fn new(
        pool: &Pool<'_>,
        cells: usize,
        cell: impl Fn(&PixelError) -> Option<usize>,
        value: impl Fn(&PixelError) -> f64,
        sigma: impl Fn(&PixelError) -> f64,
    ) -> Self {
        let mut lists: Vec<Vec<f64>> = vec![Vec::new(); cells];
        let mut frames = Vec::with_capacity(pool.frames.len());
        let mut variances = Vec::with_capacity(pool.frames.len());
        for pooled in &pool.frames {
            let (mut variance, mut n) = (0.0, 0_usize);
            for p in pooled.frame.pixels.iter().filter(|p| p.is_usable()) {
                if let Some(c) = cell(p).filter(|c| *c < cells) {
                    lists[c].push(value(p));
                    variance += sigma(p).powi(2);
                    n += 1;
                }
            }
            let medians = lists.iter_mut().enumerate().filter(|(_, l)| l.len() >= FEWEST_PIXELS).map(|(cell, list)| {
                let pixels = list.len();
                Median { cell, value: median(list), pixels }
            });
            frames.push(medians.collect());
            variances.push(variance / n.max(1) as f64);
            lists.iter_mut().for_each(Vec::clear);
        }
        Self { cells, frames, variances }
    }

    /// The cells; every frame has the same weight.
    pub(super) fn cells(&self) -> Vec<Cell> {
        let mut lists: Vec<Vec<Median>> = vec![Vec::new(); self.cells];
        for m in self.frames.iter().flatten() {
            lists[m.cell].push(*m);
        }
        lists.iter().map(|list| summary(list)).collect()
    }

    /// Tests for a smooth pattern over the cells that does not average out over the frames. `basis` has the values of the
    /// functions that span the pattern: one row per cell, one column per function.
    ///
    /// The sum of squares that the pattern explains is compared with its distribution under random signs of whole frames, so
    /// that correlated pixels, errors of poses, and noise that differs between frames do not bias the test. Frames are
    /// weighted by their noise for the p-value, and equally for the size in mm.
    pub(super) fn structure(&self, basis: &[Vec<f64>]) -> Structure {
        // Frames disagree by more than the noise of their pixels; sizes do not change when signs do.
        let mut sizes: Vec<f64> = self.frames.iter().flatten().map(|m| m.value.abs()).collect();
        let spread = median(&mut sizes).powi(2);
        let mut weighted = Score::new(self, basis, |f| {
            let variance = self.variances[f] + spread;
            if variance > 0.0 { 1.0 / variance } else { 0.0 }
        });
        let mut plain = Score::new(self, basis, |_| 1.0);
        let ones = vec![1.0; self.frames.len()];
        let (observed, size) = (weighted.of(&ones), plain.of(&ones));
        let mut rng = sign_generator();
        let mut signs = ones;
        let (mut exceeding, mut sizes) = (0, Vec::with_capacity(FLIPS));
        for _ in 0..FLIPS {
            signs.iter_mut().for_each(|s| *s = if rng.random::<bool>() { 1.0 } else { -1.0 });
            // The tolerance keeps rounding from counting the same pattern of signs as smaller.
            exceeding += usize::from(weighted.of(&signs) >= observed * (1.0 - 1e-9));
            sizes.push(plain.of(&signs));
        }
        let chance = sizes.iter().sum::<f64>() / sizes.len() as f64;
        sizes.sort_by(f64::total_cmp);
        let rare = depthcal_statistics::quantile_of_sorted(&sizes, 0.95);
        let medians = self.frames.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        Structure {
            p_value: (1 + exceeding) as f64 / (1 + FLIPS) as f64,
            size_mm: ((size - chance).max(0.0) / medians).sqrt(),
            hidden_mm: (rare / medians).sqrt(),
        }
    }
}

/// The sum of squares bᵀ(XᵀWX)⁻¹b that a pattern explains; b is the sum of the frames' XᵀWy.
struct Score {
    inverse: DMatrix<f64>,
    frames: Vec<DVector<f64>>,
    sum: DVector<f64>,
}

impl Score {
    fn new(binned: &Binned, basis: &[Vec<f64>], weight: impl Fn(usize) -> f64) -> Self {
        let n = basis.first().map_or(0, Vec::len);
        let mut normal = DMatrix::zeros(n, n);
        let mut frames = Vec::with_capacity(binned.frames.len());
        for (f, medians) in binned.frames.iter().enumerate() {
            let mut right = DVector::zeros(n);
            for m in medians {
                let x = DVector::from_column_slice(&basis[m.cell]);
                normal.ger(weight(f), &x, &x, 1.0);
                right.axpy(weight(f) * m.value, &x, 1.0);
            }
            frames.push(right);
        }
        // The pseudo-inverse counts functions that are equal on these cells once.
        let scale = normal.diagonal().max();
        let inverse = normal.pseudo_inverse(1e-9 * scale).unwrap_or_else(|_| DMatrix::zeros(n, n));
        Self { inverse, frames, sum: DVector::zeros(n) }
    }

    fn of(&mut self, signs: &[f64]) -> f64 {
        self.sum.fill(0.0);
        for (b, sign) in self.frames.iter().zip(signs) {
            self.sum.axpy(*sign, b, 1.0);
        }
        self.sum.dot(&(&self.inverse * &self.sum))
    }
}

/// Values of the Legendre polynomials up to an order at points of [−1, 1].
pub(super) fn legendre(order: usize, t: f64) -> Vec<f64> {
    let mut values = vec![1.0, t];
    for n in 1..order {
        let n = n as f64;
        let next = ((2.0 * n + 1.0) * t * values[values.len() - 1] - n * values[values.len() - 2]) / (n + 1.0);
        values.push(next);
    }
    values.truncate(order + 1);
    values
}

/// Smooth functions over `bins` equal bins, one row per bin.
pub(super) fn smooth(bins: usize, order: usize) -> Vec<Vec<f64>> {
    (0..bins).map(|i| legendre(order, (2 * i + 1) as f64 / bins as f64 - 1.0)).collect()
}

/// Smooth functions over a grid, row by row: products of total order up to `order`.
pub(super) fn smooth_over([columns, rows]: [usize; 2], order: usize) -> Vec<Vec<f64>> {
    let (x, y) = (smooth(columns, order), smooth(rows, order));
    let products = |i: usize| {
        let (a, b) = (&x[i % columns], &y[i / columns]);
        (0..=order).flat_map(|n| (0..=n).map(move |k| a[n - k] * b[k])).collect()
    };
    (0..columns * rows).map(products).collect()
}

fn summary(list: &[Median]) -> Cell {
    let frames = list.len();
    let pixels = list.iter().map(|m| m.pixels).sum();
    let value = list.iter().map(|m| m.value).sum::<f64>() / frames as f64;
    let spread = list.iter().map(|m| (m.value - value).powi(2)).sum::<f64>();
    let error = if frames < FEWEST_FRAMES { f64::NAN } else { (spread / (frames * (frames - 1)) as f64).sqrt() };
    let half = error * student_quantile(0.975, frames.saturating_sub(1));
    Cell { value, half, frames, pixels }
}

/// Equal bins over the bulk of some values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
    pub bins: usize,
}

impl Axis {
    /// Bins between the first and last half per cent of the values; `None` where they do not vary.
    pub(super) fn over(values: impl Iterator<Item = f64>, bins: usize) -> Option<Self> {
        let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let low = depthcal_statistics::quantile_of_sorted(&sorted, 0.005);
        let high = depthcal_statistics::quantile_of_sorted(&sorted, 0.995);
        (high - low > 1e-9 * high.abs().max(1e-9)).then_some(Self { low, high, bins })
    }

    /// The bin of a value.
    pub(super) fn bin(&self, value: f64) -> Option<usize> {
        let t = (value - self.low) / (self.high - self.low);
        // A value at the upper end belongs to the last bin.
        (0.0..=1.0).contains(&t).then(|| ((t * self.bins as f64) as usize).min(self.bins - 1))
    }

    /// Middle of a bin.
    pub(super) fn middle(&self, bin: usize) -> f64 {
        self.low + (bin as f64 + 0.5) * self.width()
    }

    /// Width of a bin.
    pub(super) fn width(&self) -> f64 {
        (self.high - self.low) / self.bins as f64
    }
}
