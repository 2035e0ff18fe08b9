//! Uncertainty of corrected depth and the region in which a calibration is supported, for every pixel of every frame.

use std::sync::OnceLock;

use depthcal_model::uncertainty::UncertainDepth;
use rayon::prelude::*;

use crate::bands::CHUNK;

/// Columns of the grid over the image, and planes of depth.
const FINE: [usize; 2] = [17, 17];
/// Both for cameras of many parameters, each of which is changed at every node.
const COARSE: [usize; 2] = [9, 9];
/// Free parameters beyond which the grid is coarse.
const MANY: usize = 60;
/// Measured depth goes from this share of the nearest board to this multiple of the farthest.
const BEYOND: [f64; 2] = [0.5, 2.0];
/// Range of depth where no boards are known, mm.
const WITHOUT_BOARDS_MM: [f64; 2] = [300.0, 6000.0];

/// Whether a calibration is supported at a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Supported {
    /// There is no measured depth, or none that can be corrected.
    NoDepth = 0,
    /// No board was seen there, or none at such a depth: the calibration extrapolates.
    Extrapolated = 128,
    /// Boards were seen there and at such depths.
    Yes = 255,
}

/// Standard deviations of corrected depth on a grid over image and the logarithm of measured depth.
#[derive(Debug, Clone)]
pub(crate) struct UncertaintyVolume {
    size: [usize; 2],
    /// Columns, rows, planes.
    grid: [usize; 3],
    /// Logarithm of the first plane's depth in mm, and step between planes.
    first: f32,
    step: f32,
    /// σ over depth, of every node; planes follow each other.
    relative: Vec<f32>,
    /// Whether boards were seen at each pixel; empty where no board is known.
    seen: Vec<bool>,
    range_mm: [f32; 2],
}

/// A volume that is evaluated when it is asked for first.
#[derive(Debug, Clone)]
pub(crate) struct LazyVolume {
    depth: UncertainDepth,
    volume: OnceLock<UncertaintyVolume>,
}

impl LazyVolume {
    pub fn new(depth: UncertainDepth) -> Self {
        Self { depth, volume: OnceLock::new() }
    }

    pub fn get(&self) -> &UncertaintyVolume {
        self.volume.get_or_init(|| UncertaintyVolume::new(&self.depth))
    }
}

impl UncertaintyVolume {
    fn new(depth: &UncertainDepth) -> Self {
        let camera = &depth.camera;
        let parameters = camera.free_parameters().len();
        let size = [camera.width, camera.height];
        let [columns, planes] = if parameters > MANY { COARSE } else { FINE };
        let rows = ((columns * size[1]) as f64 / size[0] as f64).round().max(2.0) as usize;
        let boards = depth.support.as_ref().map(|support| support.range_mm);
        let [near, far] = boards.map_or(WITHOUT_BOARDS_MM, |[near, far]| [BEYOND[0] * near, BEYOND[1] * far]);
        let (first, step) = (near.ln(), (far / near).ln() / (planes - 1) as f64);
        let place = |i: usize, n: usize, size: usize| i as f64 * (size as f64 - 1.0) / (n - 1) as f64;
        let node = |index: usize| {
            let [plane, cell] = [index % planes, index / planes];
            let pixel = [place(cell % columns, columns, size[0]), place(cell / columns, rows, size[1])];
            let measured_mm = (first + step * plane as f64).exp();
            (depth.std_dev(&depth.at(pixel), measured_mm).total_mm() / measured_mm) as f32
        };
        let relative = (0..columns * rows * planes).into_par_iter().map(node).collect();
        let seen = depth.support.as_ref().map_or_else(Vec::new, |support| support.pixels(camera));
        let range_mm =
            depth.support.as_ref().map_or([0.0, f32::INFINITY], |support| support.supported_mm().map(|z| z as f32));
        let grid = [columns, rows, planes];
        Self { size, grid, first: first as f32, step: step as f32, relative, seen, range_mm }
    }

    /// σ of the corrected depth at a pixel and a measured depth, mm; NaN where there is none. Trilinear in σ over depth; beyond
    /// the planes that ratio is that of the last one.
    #[inline(always)]
    fn sigma_mm(&self, column: usize, row: usize, measured_mm: f32) -> f32 {
        let [columns, rows, planes] = self.grid;
        let place = |i: usize, n: usize, size: usize| {
            let x = i as f32 * (n - 1) as f32 / (size.max(2) - 1) as f32;
            let cell = (x as usize).min(n - 2);
            (cell, x - cell as f32)
        };
        let ((u, fu), (v, fv)) = (place(column, columns, self.size[0]), place(row, rows, self.size[1]));
        let w = ((measured_mm.ln() - self.first) / self.step).clamp(0.0, (planes - 1) as f32);
        let plane = (w as usize).min(planes - 2);
        let fw = w - plane as f32;
        let line = |u: usize, v: usize| {
            let node = (v * columns + u) * planes + plane;
            self.relative[node] + fw * (self.relative[node + 1] - self.relative[node])
        };
        let [upper, lower] = [v, v + 1].map(|v| line(u, v) + fu * (line(u + 1, v) - line(u, v)));
        (upper + fv * (lower - upper)) * measured_mm
    }

    /// σ of every pixel of a frame into `out_mm`; `measured_mm` gives its depth, 0 where there is none. Allocates nothing.
    pub fn sigmas(&self, measured_mm: impl Fn(usize) -> f32 + Sync, out_mm: &mut [f32]) {
        self.each(out_mm, |index, column, row| match measured_mm(index) {
            z if z > 0.0 => self.sigma_mm(column, row, z),
            _ => f32::NAN,
        });
    }

    /// Support of every pixel of a frame into `out`; `corrected_mm` gives its depth, 0 or NaN where there is none.
    pub fn support(&self, corrected_mm: impl Fn(usize) -> f32 + Sync, out: &mut [u8]) {
        self.each(out, |index, _, _| {
            let z = corrected_mm(index);
            let in_range = z >= self.range_mm[0] && z <= self.range_mm[1];
            (match (z > 0.0, in_range && self.seen.get(index).is_some_and(|seen| *seen)) {
                (false, _) => Supported::NoDepth,
                (true, false) => Supported::Extrapolated,
                (true, true) => Supported::Yes,
            }) as u8
        });
    }

    fn each<T: Send>(&self, out: &mut [T], value: impl Fn(usize, usize, usize) -> T + Sync) {
        let width = self.size[0];
        out.par_chunks_mut(16 * CHUNK).enumerate().for_each(|(band, out)| {
            let first = band * 16 * CHUNK;
            let [mut column, mut row] = [first % width, first / width];
            for (k, out) in out.iter_mut().enumerate() {
                *out = value(first + k, column, row);
                column += 1;
                if column == width {
                    [column, row] = [0, row + 1];
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use depthcal_model::uncertainty::{DepthNoise, Support, UncertainCamera, UncertainDepth};
    use depthcal_model::{Camera, Context};
    use nalgebra::{DMatrix, Isometry3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use crate::tests::block;
    use crate::{Corrector, CorrectorError};

    /// Width and height, px.
    const SIZE: [usize; 2] = [64, 48];

    fn uncertain(std_dev: f64, noise: DepthNoise) -> UncertainDepth {
        let depth = block("projective", &[1e-5, 0.0, 0.0, 1.006]);
        let camera = Camera::new(SIZE[0], SIZE[1], [60.0, 60.0, 31.5, 23.5, 0.0], vec![depth]);
        let place = camera.theta().len() - 1;
        let covariance = DMatrix::from_element(1, 1, std_dev * std_dev);
        UncertainDepth::new(&UncertainCamera::new(camera, &[place], &covariance), noise, Context::default())
    }

    /// ρ_m = dw ρ + …: a change of dw by σ changes corrected depth by z σ / dw, and noise of b mm becomes b z² / z_m² / dw.
    #[test]
    fn sigma_is_that_of_the_closed_form() {
        let depth = uncertain(0.004, DepthNoise { a_per_mm: 0.0, b_mm: 2.0 });
        let corrector = Corrector::new(&depth.camera).unwrap().with_uncertainty(depth);
        let measured = vec![1000.0f32; SIZE[0] * SIZE[1]];
        let (mut sigma, mut z) = (measured.clone(), measured.clone());
        corrector.uncertainty_f32(&measured, &mut sigma).unwrap();
        corrector.correct_f32_in_place(&mut z, &crate::FrameContext::default()).unwrap();
        for (sigma, z) in sigma.iter().zip(&z) {
            let z = f64::from(*z);
            let expected = (0.004 * z / 1.006).hypot(2.0 * (z / 1000.0).powi(2) / 1.006);
            // The term of the column makes z_m, at which ρ_m = ρ dw + du x, differ a little from ρ dw.
            assert!((f64::from(*sigma) / expected - 1.0).abs() < 0.01, "{sigma} mm, expected {expected} mm");
        }
    }

    /// Between the nodes, and with noise that grows with the square of depth, the grid is as good as the camera itself.
    #[test]
    fn the_grid_is_within_two_per_cent_of_the_camera() {
        let mut depth = uncertain(0.001, DepthNoise { a_per_mm: 2e-6, b_mm: 1.0 });
        let poses = [400.0, 3000.0].map(|z| Isometry3::translation(-100.0, -50.0, z));
        depth.support = Support::of_boards(&depth.camera, [[0.0, 0.0], [200.0, 100.0]], &poses);
        let corrector = Corrector::new(&depth.camera).unwrap().with_uncertainty(depth.clone());
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let steps: Vec<u16> = (0..SIZE[0] * SIZE[1]).map(|_| rng.random_range(250..6000)).collect();
        let mut sigma = vec![0.0; steps.len()];
        corrector.uncertainty_u16(&steps, 1.0, &mut sigma).unwrap();
        for (index, (sigma, steps)) in sigma.iter().zip(&steps).enumerate() {
            let pixel = [(index % SIZE[0]) as f64, (index / SIZE[0]) as f64];
            let exact = depth.std_dev(&depth.at(pixel), f64::from(*steps)).total_mm();
            assert!((f64::from(*sigma) / exact - 1.0).abs() < 0.02, "{sigma} mm at {steps} mm, exactly {exact} mm");
        }
    }

    #[test]
    fn the_mask_tells_supported_from_extrapolated() {
        let mut depth = uncertain(0.001, DepthNoise { a_per_mm: 2e-6, b_mm: 0.0 });
        let pose = Isometry3::translation(-100.0, -50.0, 500.0);
        depth.support = Support::of_boards(&depth.camera, [[0.0, 0.0], [200.0, 100.0]], &[pose]);
        let corrector = Corrector::new(&depth.camera).unwrap().with_uncertainty(depth.clone());
        let middle = 24 * SIZE[0] + 32;
        let mut mm = vec![500.0f32; SIZE[0] * SIZE[1]];
        mm[middle + 1] = 900.0;
        mm[middle + 2] = f32::NAN;
        let mut mask = vec![7; mm.len()];
        corrector.support(&mm, &mut mask).unwrap();
        assert_eq!(mask[middle..middle + 3], [255, 128, 0]);
        assert_eq!(mask[0], 128, "the corner, which no board covered");
        let mut sigma = vec![0.0; mm.len()];
        corrector.uncertainty_f32(&mm, &mut sigma).unwrap();
        assert!(sigma[middle + 2].is_nan() && sigma[0] > 0.0);
        let without = Corrector::new(&depth.camera).unwrap();
        assert_eq!(without.support(&mm, &mut mask), Err(CorrectorError::NoUncertainty));
    }
}
