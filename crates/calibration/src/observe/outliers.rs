//! Depth pixels that are no measurements of the board: the background past its edge or through a hole, something in front of
//! it, wild values; and pixels that mix the board with one of these.
//!
//! A frame's pixels are compared with a plane of the frame's own, which is fitted robustly to its measured inverse depths. D and
//! errors of the pose keep planes planar, so that neither a camera that is wrong by centimetres nor a board that moved has
//! outliers, and no depth model can hide its own errors as outliers.

use depthcal_statistics::{Thinning, upper_median};
use nalgebra::{Matrix3, Vector3};

use super::board_pixels::BoardPixel;

/// Robust standard deviations beyond which a pixel may be an outlier.
pub const OUTLIER_SIGMAS: f64 = 20.0;
/// Share of the distance beyond which such a pixel is one.
pub const OUTLIER_SHARE: f64 = 0.05;
/// Pixels this near to an outlier, px, are mixed where they deviate as well.
const RIM_PX: i64 = 2;
/// Robust standard deviations beyond which a pixel beside an outlier is mixed.
const RIM_SIGMAS: f64 = 4.0;
/// Fewest pixels for a plane.
const FEWEST_PIXELS: usize = 12;
/// Most pixels that a plane is fitted to.
const MOST_PIXELS: usize = 2000;
/// Tukey's biweight leaves residuals beyond this many robust standard deviations out.
const TUKEY: f64 = 6.0;
/// Relative standard deviation below which noise is rounding.
const LEAST_RELATIVE_SIGMA: f64 = 1e-7;

/// A frame's own plane, affine in the ray in inverse depth, and the scatter about it.
#[derive(Debug, Clone, Copy)]
pub struct OwnPlane {
    plane: Vector3<f64>,
    sigma: f64,
    /// Median distance of its pixels, mm.
    distance_mm: f64,
}

impl OwnPlane {
    /// Fits the plane by iteratively reweighted least squares with Tukey's biweight (Huber 1981, 7.8), from the board's own plane
    /// scaled by the median ratio of measured to expected. `None` with too few pixels, or where they lie on a line.
    pub fn of(pixels: &[BoardPixel]) -> Option<Self> {
        if pixels.len() < FEWEST_PIXELS {
            return None;
        }
        let thinning = Thinning::new(pixels.len(), MOST_PIXELS);
        let chosen: Vec<&BoardPixel> = (0..).zip(pixels).filter(|(i, _)| thinning.keeps(*i)).map(|(_, p)| p).collect();
        let row = |p: &BoardPixel| Vector3::new(p.ray[0], p.ray[1], 1.0);
        let mut ratios: Vec<f64> = chosen.iter().map(|p| p.board_depth_mm / p.depth_mm).collect();
        let ratio = upper_median(&mut ratios)?;
        let mut distances: Vec<f64> = chosen.iter().map(|p| p.depth_mm).collect();
        let distance_mm = upper_median(&mut distances)?;
        let floor = LEAST_RELATIVE_SIGMA / distance_mm;
        let mut residuals: Vec<f64> = chosen.iter().map(|p| 1.0 / p.depth_mm - ratio / p.board_depth_mm).collect();
        let mut sigma = robust_sigma(&residuals)?.max(floor);
        let mut plane = Vector3::zeros();
        for _ in 0..12 {
            let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
            for (p, r) in chosen.iter().zip(&residuals) {
                let t = r / (TUKEY * sigma);
                let weight = if t.abs() < 1.0 { (1.0 - t * t).powi(2) } else { 0.0 };
                let row = row(p);
                normal += row * row.transpose() * weight;
                rhs += row * (weight / p.depth_mm);
            }
            plane = normal.cholesky()?.solve(&rhs);
            for (p, r) in chosen.iter().zip(&mut residuals) {
                *r = 1.0 / p.depth_mm - plane.dot(&row(p));
            }
            let next = robust_sigma(&residuals)?.max(floor);
            let settled = (next / sigma - 1.0).abs() < 1e-3;
            sigma = next;
            if settled {
                break;
            }
        }
        Some(Self { plane, sigma, distance_mm })
    }

    /// Deviation of a pixel from the plane in inverse depth, 1/mm, and the plane's inverse depth there, 1/mm.
    fn deviation(&self, p: &BoardPixel) -> (f64, f64) {
        let expected = self.plane.dot(&Vector3::new(p.ray[0], p.ray[1], 1.0));
        (1.0 / p.depth_mm - expected, expected)
    }

    /// Whether a pixel is more than [`OUTLIER_SIGMAS`] and [`OUTLIER_SHARE`] of the distance off.
    pub fn is_outlier(&self, p: &BoardPixel) -> bool {
        let (deviation, expected) = self.deviation(p);
        // Off by a share of the distance: z_m / z − 1 = ρ / ρ_m − 1.
        let off = expected * p.depth_mm - 1.0;
        deviation.abs() > OUTLIER_SIGMAS * self.sigma && off.abs() > OUTLIER_SHARE
    }

    /// Depth error from which on a pixel at the frame's median distance is an outlier, mm.
    pub fn limit_mm(&self) -> f64 {
        let z = self.distance_mm;
        (OUTLIER_SIGMAS * self.sigma * z * z).max(OUTLIER_SHARE * z)
    }
}

/// Standard deviation about zero from the median of the sizes; `None` of nothing.
fn robust_sigma(residuals: &[f64]) -> Option<f64> {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    upper_median(&mut sizes).map(|m| 1.4826 * m)
}

/// Takes the outliers out of a frame's pixels; returns how many there were and the limit at the frame's distance, mm.
/// Nothing is taken where the pixels have no plane of their own.
pub fn remove_outliers(pixels: &mut Vec<BoardPixel>) -> (usize, Option<f64>) {
    let Some(plane) = OwnPlane::of(pixels) else { return (0, None) };
    let before = pixels.len();
    pixels.retain(|p| !plane.is_outlier(p));
    (before - pixels.len(), Some(plane.limit_mm()))
}

/// Takes outliers and mixed pixels beside them out of the pixels of a depth image. What is left may be fitted.
pub fn remove_outliers_and_rim(pixels: &mut Vec<BoardPixel>) {
    let Some(plane) = OwnPlane::of(pixels) else { return };
    let outliers: Vec<[i64; 2]> = pixels.iter().filter(|p| plane.is_outlier(p)).map(place).collect();
    if outliers.is_empty() {
        return;
    }
    let beside = Beside::of(&outliers);
    pixels.retain(|p| {
        let mixed = || beside.contains(place(p)) && plane.deviation(p).0.abs() > RIM_SIGMAS * plane.sigma;
        !plane.is_outlier(p) && !mixed()
    });
}

fn place(p: &BoardPixel) -> [i64; 2] {
    p.pixel.map(|c| c.round() as i64)
}

/// The pixels within [`RIM_PX`] of some pixels, as a bitmap of the part of the image that these span.
struct Beside {
    low: [i64; 2],
    columns: i64,
    near: Vec<bool>,
}

impl Beside {
    fn of(places: &[[i64; 2]]) -> Self {
        let bound = |i: usize| {
            let coordinates = places.iter().map(|p| p[i]);
            (coordinates.clone().min().unwrap_or(0) - RIM_PX, coordinates.max().unwrap_or(0) + RIM_PX)
        };
        let ((left, right), (top, bottom)) = (bound(0), bound(1));
        let columns = right - left + 1;
        let mut beside = Self { low: [left, top], columns, near: vec![false; (columns * (bottom - top + 1)) as usize] };
        for [u, v] in places {
            for dv in -RIM_PX..=RIM_PX {
                for du in -RIM_PX..=RIM_PX {
                    let i = (v + dv - top) * columns + u + du - left;
                    beside.near[i as usize] = true;
                }
            }
        }
        beside
    }

    fn contains(&self, [u, v]: [i64; 2]) -> bool {
        let [x, y] = [u - self.low[0], v - self.low[1]];
        let inside = x >= 0 && y >= 0 && x < self.columns;
        inside && self.near.get((y * self.columns + x) as usize).is_some_and(|n| *n)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, Normal};

    use super::*;

    /// A tilted board at 600 mm, measured 4 % too near by a D that also tilts it, with noise of 1.5 mm.
    fn board(seed: u64) -> Vec<BoardPixel> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, 1.5).unwrap();
        let pixels = (0..120).flat_map(|v| (0..160).map(move |u| (u, v)));
        pixels
            .map(|(u, v)| {
                let ray = [(f64::from(u) - 80.0) / 200.0, (f64::from(v) - 60.0) / 200.0];
                let rho = 1.0 / 600.0 + 2e-4 * ray[0] - 1e-4 * ray[1];
                let measured = 1.04 * rho + 3e-5 * ray[0] - 1e-5;
                BoardPixel {
                    number: 0,
                    pixel: [f64::from(u), f64::from(v)],
                    depth_mm: 1.0 / measured + noise.sample(&mut rng),
                    board_depth_mm: 1.0 / rho,
                    board: [0.0; 2],
                    ray,
                    cos_incidence: 1.0,
                }
            })
            .collect()
    }

    #[test]
    fn a_wrong_camera_has_no_outliers() {
        let mut pixels = board(1);
        let n = pixels.len();
        let (count, limit) = remove_outliers(&mut pixels);
        assert_eq!((count, pixels.len()), (0, n));
        // 20 robust standard deviations of 1.5 mm, or 5 % of 577 mm, whichever is more.
        assert!((limit.unwrap() - 30.0).abs() < 1.5, "{limit:?}");
    }

    /// A third of the pixels shows a wall far behind, one pixel in 50 is wild, and the wall's rim is mixed.
    #[test]
    fn the_background_goes_and_so_does_its_rim() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut pixels = board(2);
        let (mut wall, mut wild, mut mixed) = (0, 0, 0);
        for p in &mut pixels {
            let u = p.pixel[0];
            if u < 50.0 {
                p.depth_mm = 2000.0;
                wall += 1;
            } else if u < 51.0 {
                // Less than 5 % of the distance: no outlier by the rule, but 16 standard deviations off.
                p.depth_mm += 24.0;
                mixed += 1;
            } else if rng.random::<f64>() < 0.02 {
                p.depth_mm *= rng.random_range(1.2..4.0);
                wild += 1;
            }
        }
        let n = pixels.len();
        let mut without_outliers = pixels.clone();
        assert_eq!(remove_outliers(&mut without_outliers).0, wall + wild);
        let mut fitted = pixels;
        remove_outliers_and_rim(&mut fitted);
        let noise = fitted.len() as i64 - (n - wall - wild - mixed) as i64;
        assert!((-3..=0).contains(&noise), "{noise}: all mixed pixels and at most some beyond four deviations go");
    }

    #[test]
    fn few_pixels_are_left_alone() {
        let mut pixels = board(3);
        pixels.truncate(5);
        pixels[0].depth_mm = 9000.0;
        assert_eq!(remove_outliers(&mut pixels), (0, None));
    }
}
