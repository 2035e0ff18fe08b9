//! Board pixels with their residuals in the cells of grids over the covariates, in which frames are compared.

use super::along::Along;
use crate::calibrate::CalibratedCamera;
use crate::judge::depth_errors::PixelError;

/// Side of the finest cells on the board and in depth, mm.
const CELL_MM: f64 = 2.0;
/// Cells over the logarithm of the amplitude and over the cosine of incidence, from edge-on to frontal.
const LINE_CELLS: u32 = 256;
/// Cells per e-fold of amplitude: some 2 % each.
const CELLS_PER_LOG: f64 = 50.0;
/// Distance from the edge of the grid to the board's origin, mm: the board goes on outside the rectangle of its markers.
const BOARD_MARGIN_MM: f64 = 100.0;
/// Residuals count up to this many standard deviations of the noise: single pixels do not decide.
const MOST_SIGMAS: f64 = 6.0;
/// Largest share of the mean squared residual that counts as shared: estimates may exceed it where little else is left.
pub(super) const LARGEST_SHARE: f64 = 0.99;
/// Cells along each of two covariates together are this many times as large as those along one.
const COARSER: u16 = 8;

/// A board pixel in cells of its covariates.
#[derive(Clone, Copy)]
pub(super) struct Cells {
    pub pixel: [u16; 2],
    board: [u16; 2],
    depth: u16,
    radius: u16,
    amplitude: u16,
    incidence: u16,
    /// Residual in standard deviations of the noise.
    pub value: f32,
}

impl Cells {
    /// Middle of its cell of depth, mm.
    pub fn depth_mm(&self) -> f64 {
        (f64::from(self.depth) + 0.5) * CELL_MM
    }
}

/// One grid of cells: what it is along, and where a pixel lies in it.
pub(super) struct Cover {
    pub along: &'static [Along],
    /// Side of its finest cells in the covariates' unit; 0 where two have different ones.
    pub cell: f64,
    pub place: fn(&Cells) -> [u16; 2],
}

impl Cover {
    /// Columns and rows of the grid that has all pixels of some frames.
    pub fn size<'a>(&self, frames: impl Iterator<Item = &'a [Cells]>) -> [usize; 2] {
        let places = frames.flatten().map(self.place);
        places.fold([0; 2], |s, p| [0, 1].map(|i| usize::max(s[i], usize::from(p[i]) + 1)))
    }
}

const fn cover(along: &'static [Along], cell: f64, place: fn(&Cells) -> [u16; 2]) -> Cover {
    Cover { along, cell, place }
}

/// The grids. One covariate at a time as finely as it goes; pairs as far as an effect of both may need.
pub(super) const COVERS: [Cover; 12] = [
    cover(&[Along::Pixel], 1.0, |c| c.pixel),
    cover(&[Along::Column], 1.0, |c| [c.pixel[0], 0]),
    cover(&[Along::Row], 1.0, |c| [c.pixel[1], 0]),
    cover(&[Along::Board], CELL_MM, |c| c.board),
    cover(&[Along::Depth], CELL_MM, |c| [c.depth, 0]),
    cover(&[Along::Amplitude], 1.0 / CELLS_PER_LOG, |c| [c.amplitude, 0]),
    cover(&[Along::Incidence], 1.0 / LINE_CELLS as f64, |c| [c.incidence, 0]),
    cover(&[Along::Column, Along::Depth], 0.0, |c| [c.pixel[0] / COARSER, c.depth / COARSER]),
    cover(&[Along::Row, Along::Depth], 0.0, |c| [c.pixel[1] / COARSER, c.depth / COARSER]),
    cover(&[Along::RadiusAndDepth], 0.0, |c| [c.radius / COARSER, c.depth / COARSER]),
    cover(&[Along::Amplitude, Along::Depth], 0.0, |c| [c.amplitude / COARSER, c.depth / COARSER]),
    cover(&[Along::Amplitude, Along::Incidence], 0.0, |c| [c.amplitude / COARSER, c.incidence / COARSER]),
];

/// The cells of a frame's pixels, and the sums of their squared errors, mm², and of the inverse variances of their noise, 1/mm².
pub(super) fn cells_of(fit: &CalibratedCamera, errors: &[PixelError]) -> (Vec<Cells>, [f64; 2]) {
    let mut sums = [0.0; 2];
    let [_, _, cx, cy, _] = fit.camera.pinhole();
    let cells = errors.iter().map(|p| {
        let rho = 1.0 / p.board_depth_mm;
        let noise_mm = fit.noise.depth.sigma(rho) / (rho * rho);
        sums[0] += p.after_mm * p.after_mm;
        sums[1] += noise_mm.powi(-2);
        let cell = |x: f64, side: f64| (x / side).clamp(0.0, f64::from(u16::MAX)) as u16;
        let amplitude = p.context.amplitude.max(1.0).ln() * CELLS_PER_LOG;
        Cells {
            pixel: p.context.pixel.map(|x| cell(x + 0.5, 1.0)),
            board: p.board.map(|x| cell(x + BOARD_MARGIN_MM, CELL_MM)),
            depth: cell(p.board_depth_mm, CELL_MM),
            radius: cell((p.context.pixel[0] - cx).hypot(p.context.pixel[1] - cy), 1.0),
            amplitude: cell(amplitude, 1.0),
            incidence: cell(p.cos_incidence * f64::from(LINE_CELLS), 1.0),
            value: (p.after_mm / noise_mm).clamp(-MOST_SIGMAS, MOST_SIGMAS) as f32,
        }
    });
    (cells.collect(), sums)
}
