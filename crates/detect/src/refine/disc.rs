//! The centre of a printed disc, by fitting a model of its image.
//!
//! Every pixel around the dot is mapped to the board under the current mapping. There the dot is a disc of known size,
//! so that the fitted centre is that of the disc, not that of its image, and perspective and lens cause no bias. Blur
//! acts in the image: the signed distance to the disc's edge is converted to pixels before the edge is blurred.

use nalgebra::{Matrix2, SVector, Vector2};

use super::fit::{Fit, Model, Prior, erf, fit};
use super::pixels::Pixels;
use crate::geometry::LocalMap;

/// Number of parameters: centre x, y (mm); grey value of the paper; grey value of the dot minus that of the paper;
/// relative gradient of the light along u, v (1/px); standard deviation of the edge's blur (px); radius (mm).
const P: usize = 8;
const PAPER: usize = 2;
const CONTRAST: usize = 3;
const LIGHT_U: usize = 4;
const LIGHT_V: usize = 5;
const WIDTH: usize = 6;
const RADIUS: usize = 7;

/// Usual standard deviation of an edge's blur, from the lens and the pixel's area.
const USUAL_WIDTH_PX: f64 = 0.8;
/// Width of the ring of paper around the dot that is fitted, px.
const SURROUND_PX: f64 = 3.0;

/// Knowledge of a dot before the fit; board coordinates in mm.
pub(super) struct Disc {
    pub(super) center: [f64; 2],
    pub(super) radius: f64,
    /// Distance between its edge and that of the nearest dot, mm.
    pub(super) gap: f64,
    /// Prior standard deviation of the radius, relative to it; 0 holds it fixed.
    pub(super) radius_sigma: f64,
}

/// The fitted disc; board coordinates in mm.
pub(super) struct FittedDisc {
    pub(super) center: [f64; 2],
    /// Covariance of the centre, mm².
    pub(super) covariance: Matrix2<f64>,
    pub(super) radius: f64,
    pub(super) width_px: f64,
    pub(super) contrast: f64,
    /// Standard deviation of the grey values about the model, over the contrast.
    pub(super) relative_noise: f64,
}

struct Sample {
    board: [f64; 2],
    jacobian: Matrix2<f64>,
    offset: [f64; 2],
    value: f64,
}

struct DiscModel<'a> {
    pixels: &'a Pixels<'a>,
    samples: Vec<Sample>,
    start: [f64; 2],
    radius: f64,
}

impl DiscModel<'_> {
    /// Signed distance of a sample to the edge in px, positive outside, and its derivatives with respect to centre and
    /// radius, px/mm.
    fn distance(sample: &Sample, center: [f64; 2], radius: f64) -> (f64, Vector2<f64>, f64) {
        let e = Vector2::new(sample.board[0] - center[0], sample.board[1] - center[1]);
        let rho = e.norm().max(1e-9 * radius);
        let normal = e / rho;
        // Gradient in the image of the distance on the board, mm/px.
        let per_px = (sample.jacobian.transpose() * normal).norm().max(1e-12);
        ((rho - radius) / per_px, -normal / per_px, -1.0 / per_px)
    }
}

impl Model<P> for DiscModel<'_> {
    fn len(&self) -> usize {
        self.samples.len()
    }

    fn residual(&self, p: &SVector<f64, P>, i: usize) -> (f64, SVector<f64, P>) {
        let sample = &self.samples[i];
        let (s, to_center, to_radius) = Self::distance(sample, [p[0], p[1]], p[RADIUS]);
        let root = std::f64::consts::SQRT_2 * p[WIDTH];
        let (e, slope) = erf(s / root);
        let (inside, per_distance) = (0.5 - 0.5 * e, -0.5 * slope / root);
        let light = 1.0 + p[LIGHT_U] * sample.offset[0] + p[LIGHT_V] * sample.offset[1];
        let grey = p[PAPER] + p[CONTRAST] * inside;
        let (residual, measured) = self.pixels.residual(sample.value, light * grey);
        if !measured {
            return (0.0, SVector::zeros());
        }
        let edge = light * p[CONTRAST] * per_distance;
        let derivatives = SVector::from([
            edge * to_center.x,
            edge * to_center.y,
            light,
            light * inside,
            grey * sample.offset[0],
            grey * sample.offset[1],
            -edge * s / p[WIDTH],
            edge * to_radius,
        ]);
        (residual, derivatives)
    }

    fn is_valid(&self, p: &SVector<f64, P>) -> bool {
        let moved = (p[0] - self.start[0]).hypot(p[1] - self.start[1]);
        (0.15..8.0).contains(&p[WIDTH]) && (0.5..1.6).contains(&(p[RADIUS] / self.radius)) && moved < self.radius
    }
}

/// Fits the disc. `None` when there are too few pixels, too little contrast, or the pixels show no disc.
pub(super) fn fit_disc(pixels: &Pixels, map: &LocalMap, disc: &Disc, iterations: usize) -> Option<FittedDisc> {
    let outside = 0.55 * disc.gap;
    let mut samples = Vec::new();
    let (mut in_sum, mut in_count, mut out_sum, mut out_count) = (0.0, 0.0, 0.0, 0.0);
    let origin = [0, 1].map(|a| (map.bounds[0][a] + map.bounds[1][a]) / 2.0);
    for [x, y] in pixels.inside(map.bounds[0], map.bounds[1]) {
        let pixel = [x as f64, y as f64];
        let (board, jacobian) = map.apply(pixel);
        let rho = (board[0] - disc.center[0]).hypot(board[1] - disc.center[1]);
        let sample =
            Sample { board, jacobian, offset: [pixel[0] - origin[0], pixel[1] - origin[1]], value: pixels.value(x, y) };
        let (s, ..) = DiscModel::distance(&sample, disc.center, disc.radius);
        if s > SURROUND_PX || rho - disc.radius > outside {
            continue;
        }
        if rho < 0.6 * disc.radius {
            in_sum += sample.value;
            in_count += 1.0;
        } else if s > 0.8 {
            out_sum += sample.value;
            out_count += 1.0;
        }
        samples.push(sample);
    }
    if in_count == 0.0 || out_count < 4.0 {
        return None;
    }
    let (paper, dot) = (out_sum / out_count, in_sum / in_count);
    let start =
        SVector::from([disc.center[0], disc.center[1], paper, dot - paper, 0.0, 0.0, USUAL_WIDTH_PX, disc.radius]);
    let priors = [
        Prior { index: WIDTH, mean: USUAL_WIDTH_PX, sigma: 0.5 },
        Prior { index: RADIUS, mean: disc.radius, sigma: disc.radius * disc.radius_sigma.max(1e-6) },
        Prior { index: LIGHT_U, mean: 0.0, sigma: 0.02 },
        Prior { index: LIGHT_V, mean: 0.0, sigma: 0.02 },
    ];
    let model = DiscModel { pixels, samples, start: disc.center, radius: disc.radius };
    // Rounding to integers has a standard deviation of 0.29; the model is accurate to some thousandths of the contrast.
    let grain = 0.3_f64.max(0.003 * (dot - paper).abs());
    let Fit { parameters: p, covariance, noise } = fit(&model, start, &priors, grain, iterations)?;
    let contrast = p[CONTRAST];
    if contrast == 0.0 || contrast.signum() != (dot - paper).signum() || noise > 0.25 * contrast.abs() {
        return None;
    }
    Some(FittedDisc {
        center: [p[0], p[1]],
        covariance: covariance.fixed_view::<2, 2>(0, 0).into_owned(),
        radius: p[RADIUS],
        width_px: p[WIDTH],
        contrast,
        relative_noise: noise / contrast.abs(),
    })
}
