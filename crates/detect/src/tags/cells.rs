//! The cells of a tag in the image.

use nalgebra::{Matrix3, Vector3};

use super::quad::Quad;
use crate::geometry::Homography;
use crate::stretch::Plane;

/// Samples along one axis of a cell, and the share of the cell that they span.
const SAMPLES: usize = 3;
const SPAN: f64 = 0.5;
/// Distance outside the border at which the paper is looked at, in cells.
const PAPER: f64 = 0.5;
/// Least difference between paper and border, of the plane's range.
const LEAST_CONTRAST: f64 = 0.03;
/// Largest share of the border's cells that are white.
const MAX_WHITE_BORDER: f64 = 0.3;

/// The cells inside a tag's border, row by row from the highest bit, 1 for white; `None` where the quadrilateral has no dark
/// border or no bright paper around it. Dark and bright are planes over the tag, which uneven light tilts.
pub(super) fn read(plane: &Plane, quad: &Quad, side: usize, border: usize) -> Option<u64> {
    let n = side + 2 * border;
    let size = n as f64;
    let corners = [[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]];
    let map = Homography::fit(&corners.into_iter().zip(*quad).collect::<Vec<_>>())?;
    let grey = |p: [f64; 2]| plane.between(map.apply(p)?);
    let offset = |k: usize| SPAN * (k as f64 / (SAMPLES - 1) as f64 - 0.5);
    let cell = |column: usize, row: usize| {
        let mut sum = 0.0;
        for k in 0..SAMPLES * SAMPLES {
            sum += grey([column as f64 + 0.5 + offset(k % SAMPLES), row as f64 + 0.5 + offset(k / SAMPLES)])?;
        }
        Some(sum / (SAMPLES * SAMPLES) as f64)
    };
    let values: Vec<f64> = (0..n * n).map(|i| cell(i % n, i / n)).collect::<Option<_>>()?;
    let inside = |i: usize| [i % n, i / n].iter().all(|k| (border..n - border).contains(k));
    let middle = |i: usize| [(i % n) as f64 + 0.5, (i / n) as f64 + 0.5];
    let mut dark = Light::new(size);
    for i in (0..n * n).filter(|&i| !inside(i)) {
        dark.add(middle(i), values[i]);
    }
    let mut bright = Light::new(size);
    for k in 0..n {
        let s = k as f64 + 0.5;
        for p in [[s, -PAPER], [s, size + PAPER], [-PAPER, s], [size + PAPER, s]] {
            // A tag near the image's border may lack some of its paper.
            if let Some(value) = grey(p) {
                bright.add(p, value);
            }
        }
    }
    let (dark, bright) = (dark.plane()?, bright.plane()?);
    if (0..n * n).any(|i| bright.at(middle(i)) - dark.at(middle(i)) < LEAST_CONTRAST) {
        return None;
    }
    let white = |i: usize| values[i] > (dark.at(middle(i)) + bright.at(middle(i))) / 2.0;
    let outer = n * n - side * side;
    if (0..n * n).filter(|&i| !inside(i) && white(i)).count() as f64 > MAX_WHITE_BORDER * outer as f64 {
        return None;
    }
    Some((0..n * n).filter(|&i| inside(i)).fold(0, |code, i| code << 1 | u64::from(white(i))))
}

/// A plane of grey values over a tag, fitted to samples.
struct Light {
    middle: f64,
    normal: Matrix3<f64>,
    right: Vector3<f64>,
}

impl Light {
    fn new(size: f64) -> Light {
        Light { middle: size / 2.0, normal: Matrix3::zeros(), right: Vector3::zeros() }
    }

    fn add(&mut self, [x, y]: [f64; 2], value: f64) {
        let t = Vector3::new(1.0, x - self.middle, y - self.middle);
        self.normal += t * t.transpose();
        self.right += t * value;
    }

    fn plane(&self) -> Option<LightPlane> {
        let coefficients = self.normal.cholesky()?.solve(&self.right);
        Some(LightPlane { middle: self.middle, coefficients })
    }
}

struct LightPlane {
    middle: f64,
    coefficients: Vector3<f64>,
}

impl LightPlane {
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        self.coefficients.dot(&Vector3::new(1.0, x - self.middle, y - self.middle))
    }
}
