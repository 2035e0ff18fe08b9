//! Errors in bins: every frame contributes its median, and the frames' disagreement is the uncertainty.

use super::pool::{Pool, usable};
use super::statistics::{median, sign_generator, student};
use crate::evaluate::PixelError;
use rand::RngExt;

/// Fewest pixels of a frame that make a median.
const FEWEST_PIXELS: usize = 4;
/// Fewest frames whose disagreement is an uncertainty.
pub(super) const FEWEST_FRAMES: usize = 3;
/// Sign patterns of a test.
const FLIPS: usize = 1999;

/// A frame's median in a cell.
#[derive(Debug, Clone, Copy)]
struct Median {
    cell: usize,
    value: f64,
    pixels: usize,
}

/// What is known of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Mean of the frames' medians; NaN of an empty cell.
    pub value: f64,
    /// Its standard error from the frames' disagreement; NaN below [`FEWEST_FRAMES`] frames.
    pub error: f64,
    /// Half the width of its 95 % interval.
    pub half: f64,
    /// Frames that contribute.
    pub frames: usize,
    /// Their pixels.
    pub pixels: usize,
}

impl Cell {
    /// Whether it differs from zero by more than its interval.
    pub(super) fn stands_out(&self) -> bool {
        self.value.abs() > self.half
    }
}

/// Medians of frames in cells.
#[derive(Debug, Clone)]
pub(super) struct Binned {
    cells: usize,
    frames: Vec<Vec<Median>>,
    /// Weight of each frame in tests.
    weights: Vec<f64>,
}

/// The answer of a test for structure.
#[derive(Debug, Clone, Copy)]
pub(super) struct Structure {
    /// Probability of that much structure if every frame's errors were as likely negative as positive.
    pub p_value: f64,
    /// Root mean square of the cells' values beyond their own uncertainty, mm; 0 where the uncertainty explains them.
    pub size_mm: f64,
}

impl Binned {
    /// Bins the pixels of a pool. `cell` gives the cell of a pixel, `value` its error, `sigma` the noise of a pixel (mm).
    pub(super) fn new(
        pool: &Pool<'_>,
        cells: usize,
        cell: impl Fn(&PixelError) -> Option<usize>,
        value: impl Fn(&PixelError) -> f64,
        sigma: impl Fn(&PixelError) -> f64,
    ) -> Self {
        let mut lists: Vec<Vec<f64>> = vec![Vec::new(); cells];
        let mut frames = Vec::with_capacity(pool.frames.len());
        let mut weights = Vec::with_capacity(pool.frames.len());
        for pooled in &pool.frames {
            let (mut variance, mut n) = (0.0, 0_usize);
            for p in pooled.frame.pixels.iter().filter(|p| usable(p)) {
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
            weights.push(if variance > 0.0 { n as f64 / variance } else { 0.0 });
            lists.iter_mut().for_each(Vec::clear);
        }
        Self { cells, frames, weights }
    }

    /// The cells, every frame counting the same.
    pub(super) fn cells(&self) -> Vec<Cell> {
        let mut lists: Vec<Vec<Median>> = vec![Vec::new(); self.cells];
        for m in self.frames.iter().flatten() {
            lists[m.cell].push(*m);
        }
        lists.iter().map(|list| summary(list)).collect()
    }

    /// Whether anything is left in the cells that does not average out over the frames.
    ///
    /// Signs of whole frames are flipped: correlation between the pixels of a frame, errors of its pose, and noise that
    /// differs from frame to frame do no harm. Frames weigh by their noise, as the noise law has it.
    pub(super) fn structure(&self) -> Structure {
        let used: Vec<usize> = (0..self.frames.len()).filter(|f| !self.frames[*f].is_empty()).collect();
        let mut scale = vec![0.0; self.cells];
        let mut frames_in = vec![0_usize; self.cells];
        for f in &used {
            for m in &self.frames[*f] {
                scale[m.cell] += (self.weights[*f] * m.value).powi(2);
                frames_in[m.cell] += 1;
            }
        }
        let statistic = |sign: &dyn Fn(usize) -> f64, sums: &mut Vec<f64>| {
            sums.clear();
            sums.resize(self.cells, 0.0);
            for (i, f) in used.iter().enumerate() {
                let w = sign(i) * self.weights[*f];
                self.frames[*f].iter().for_each(|m| sums[m.cell] += w * m.value);
            }
            let cells = (0..self.cells).filter(|c| frames_in[*c] >= FEWEST_FRAMES && scale[*c] > 0.0);
            cells.map(|c| sums[c] * sums[c] / scale[c]).sum::<f64>()
        };
        let mut sums = Vec::new();
        let found = statistic(&|_| 1.0, &mut sums);
        let mut rng = sign_generator();
        let mut signs = vec![1.0; used.len()];
        let mut exceeding = 0;
        for _ in 0..FLIPS {
            signs.iter_mut().for_each(|s| *s = if rng.random::<bool>() { 1.0 } else { -1.0 });
            // Rounding must not make the same pattern of signs count as smaller.
            exceeding += usize::from(statistic(&|i| signs[i], &mut sums) >= found * (1.0 - 1e-12));
        }
        let (mut excess, mut pixels) = (0.0, 0.0);
        for cell in self.cells().iter().filter(|c| c.error.is_finite()) {
            excess += cell.pixels as f64 * (cell.value.powi(2) - cell.error.powi(2));
            pixels += cell.pixels as f64;
        }
        let size_mm = if pixels > 0.0 { (excess / pixels).max(0.0).sqrt() } else { 0.0 };
        Structure { p_value: (1 + exceeding) as f64 / (1 + FLIPS) as f64, size_mm }
    }
}

fn summary(list: &[Median]) -> Cell {
    let frames = list.len();
    let pixels = list.iter().map(|m| m.pixels).sum();
    let value = list.iter().map(|m| m.value).sum::<f64>() / frames as f64;
    let spread = list.iter().map(|m| (m.value - value).powi(2)).sum::<f64>();
    let error = if frames < FEWEST_FRAMES { f64::NAN } else { (spread / (frames * (frames - 1)) as f64).sqrt() };
    let half = error * student(frames.saturating_sub(1));
    Cell { value, error, half, frames, pixels }
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
        let low = super::statistics::quantile_of_sorted(&sorted, 0.005);
        let high = super::statistics::quantile_of_sorted(&sorted, 0.995);
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
