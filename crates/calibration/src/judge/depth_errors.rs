//! Depth errors of board pixels, and their sums over a frame.

use depthcal_io::{BeforeAfter, MeanStd};
use depthcal_model::Context;

use crate::observe::board_pixels::BoardPixel;
use crate::observe::board_plane::BoardSurface;

/// A board pixel with its depth before and after correction.
#[derive(Debug, Clone, Copy)]
pub struct PixelError {
    /// The pixel with its covariates.
    pub context: Context,
    /// The board's depth there, mm.
    pub board_depth_mm: f64,
    /// The board point, mm.
    pub board: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cos_incidence: f64,
    /// Measured minus board depth, mm.
    pub before_mm: f64,
    /// Corrected minus board depth, mm.
    pub after_mm: f64,
    /// Height of the measured point over the board, mm (board z).
    pub height_before_mm: f64,
    /// Height of the corrected point over the board, mm.
    pub height_after_mm: f64,
}

impl PixelError {
    /// Whether its depth and its errors are known.
    pub fn is_usable(&self) -> bool {
        self.before_mm.is_finite() && self.after_mm.is_finite() && self.board_depth_mm.is_finite()
    }

    /// Of a pixel as measured and as corrected, against the board's surface, without covariates.
    pub(super) fn of(measured: &BoardPixel, corrected: &BoardPixel, surface: &BoardSurface<'_>) -> Self {
        Self {
            context: Context { pixel: measured.pixel, ..Context::default() },
            board_depth_mm: measured.board_depth_mm,
            board: measured.board,
            cos_incidence: measured.cos_incidence,
            before_mm: measured.depth_mm - measured.board_depth_mm,
            after_mm: corrected.depth_mm - corrected.board_depth_mm,
            height_before_mm: surface.height(measured.ray, measured.depth_mm),
            height_after_mm: surface.height(corrected.ray, corrected.depth_mm),
        }
    }
}

/// Number of values, and the sums of their sizes and of their squares.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sums {
    /// Σ |e|, mm.
    pub sizes_mm: f64,
    /// Σ e², mm².
    pub squares_mm2: f64,
}

impl Sums {
    fn add(&mut self, value: f64) {
        self.sizes_mm += value.abs();
        self.squares_mm2 += value * value;
    }

    fn merge(&mut self, other: &Self) {
        self.sizes_mm += other.sizes_mm;
        self.squares_mm2 += other.squares_mm2;
    }
}

/// Sums over all board pixels of a frame, or of several.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DepthErrors {
    /// Number of pixels.
    pub pixels: usize,
    /// Of depth minus the board's depth.
    pub depth: BeforeAfter<Sums>,
    /// Of heights over the board.
    pub height: BeforeAfter<Sums>,
}

impl DepthErrors {
    /// Counts a pixel; not one of whose errors any is not finite, which would spoil the sums.
    pub fn add(&mut self, p: &PixelError) {
        if ![p.before_mm, p.after_mm, p.height_before_mm, p.height_after_mm].iter().all(|e| e.is_finite()) {
            return;
        }
        self.pixels += 1;
        self.depth.before.add(p.before_mm);
        self.depth.after.add(p.after_mm);
        self.height.before.add(p.height_before_mm);
        self.height.after.add(p.height_after_mm);
    }

    /// The sums of some pixels.
    pub fn of<'a>(pixels: impl IntoIterator<Item = &'a PixelError>) -> Self {
        let mut sums = Self::default();
        pixels.into_iter().for_each(|p| sums.add(p));
        sums
    }

    /// The sums of several frames.
    pub fn over<'a>(frames: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        for frame in frames {
            all.pixels += frame.pixels;
            all.depth.before.merge(&frame.depth.before);
            all.depth.after.merge(&frame.depth.after);
            all.height.before.merge(&frame.height.before);
            all.height.after.merge(&frame.height.after);
        }
        all
    }

    /// Root mean square of depth minus the board's depth, mm; `None` of no pixels.
    pub fn rms_mm(&self) -> Option<BeforeAfter<f64>> {
        let rms = |sums: &Sums| (sums.squares_mm2 / self.pixels as f64).sqrt();
        (self.pixels > 0).then(|| BeforeAfter { before: rms(&self.depth.before), after: rms(&self.depth.after) })
    }

    /// Mean and standard deviation of absolute heights over the board (thesis eq. 5.4, 5.5), mm; `None` of no pixels.
    pub fn plane_error_mm(&self) -> Option<BeforeAfter<MeanStd>> {
        let n = self.pixels as f64;
        let mean_std = |sums: &Sums| {
            let mean = sums.sizes_mm / n;
            MeanStd { mean, std: (sums.squares_mm2 / n - mean * mean).max(0.0).sqrt() }
        };
        (self.pixels > 0)
            .then(|| BeforeAfter { before: mean_std(&self.height.before), after: mean_std(&self.height.after) })
    }
}
