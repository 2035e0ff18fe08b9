//! The inverse of the mapping from board to image around one marker, in closed form.

use nalgebra::{Matrix2, SMatrix};

/// Terms of a cubic in two variables.
const TERMS: usize = 10;
/// Samples along one side of the neighbourhood.
const SIDE: usize = 7;

/// Board coordinates (mm) as a cubic polynomial in pixel coordinates around a marker. Within a dot a cubic represents
/// perspective and lens to better than 10⁻⁴ px, and its derivatives are exact and cheap.
#[derive(Debug, Clone)]
pub(crate) struct LocalMap {
    center: [f64; 2],
    /// px
    scale: [f64; 2],
    coefficients: [[f64; TERMS]; 2],
    /// Smallest and largest pixel coordinates of the neighbourhood.
    pub(crate) bounds: [[f64; 2]; 2],
}

impl LocalMap {
    /// Samples `pixel_from_board` on a square of half side `reach` mm around the point `board` (mm) and inverts it.
    /// `None` where the mapping is undefined or folds.
    pub(crate) fn new(
        pixel_from_board: &dyn Fn([f64; 2]) -> Option<[f64; 2]>,
        board: [f64; 2],
        reach: f64,
    ) -> Option<LocalMap> {
        let mut samples = Vec::with_capacity(SIDE * SIDE);
        for i in 0..SIDE * SIDE {
            let offset = |k: usize| (2.0 * k as f64 / (SIDE - 1) as f64 - 1.0) * reach;
            let p = [board[0] + offset(i % SIDE), board[1] + offset(i / SIDE)];
            let q = pixel_from_board(p)?;
            if !(q[0].is_finite() && q[1].is_finite()) {
                return None;
            }
            samples.push((p, q));
        }
        let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for (_, q) in &samples {
            for axis in 0..2 {
                bounds[0][axis] = bounds[0][axis].min(q[axis]);
                bounds[1][axis] = bounds[1][axis].max(q[axis]);
            }
        }
        let center = [0, 1].map(|a| (bounds[0][a] + bounds[1][a]) / 2.0);
        let scale = [0, 1].map(|a| ((bounds[1][a] - bounds[0][a]) / 2.0).max(1e-9));
        let mut map = LocalMap { center, scale, coefficients: [[0.0; TERMS]; 2], bounds };
        let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
        let mut right = SMatrix::<f64, TERMS, 2>::zeros();
        for (p, q) in &samples {
            let t = SMatrix::<f64, TERMS, 1>::from(map.terms(*q).0);
            normal.ger(1.0, &t, &t, 1.0);
            right += t * SMatrix::<f64, 1, 2>::new(p[0] - board[0], p[1] - board[1]);
        }
        let solution = normal.cholesky()?.solve(&right);
        for axis in 0..2 {
            for i in 0..TERMS {
                map.coefficients[axis][i] = solution[(i, axis)];
            }
            map.coefficients[axis][0] += board[axis];
        }
        let worst = samples
            .iter()
            .map(|(p, q)| {
                let (b, _) = map.apply(*q);
                (b[0] - p[0]).hypot(b[1] - p[1])
            })
            .fold(0.0, f64::max);
        (worst < 0.05 * reach).then_some(map)
    }

    /// Monomials and their derivatives with respect to u and v.
    fn terms(&self, pixel: [f64; 2]) -> ([f64; TERMS], [f64; TERMS], [f64; TERMS]) {
        let (a, b) = (1.0 / self.scale[0], 1.0 / self.scale[1]);
        let (x, y) = ((pixel[0] - self.center[0]) * a, (pixel[1] - self.center[1]) * b);
        (
            [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y],
            [0.0, a, 0.0, 2.0 * x * a, y * a, 0.0, 3.0 * x * x * a, 2.0 * x * y * a, y * y * a, 0.0],
            [0.0, 0.0, b, 0.0, x * b, 2.0 * y * b, 0.0, x * x * b, 2.0 * x * y * b, 3.0 * y * y * b],
        )
    }

    /// Board coordinates of a pixel in mm, and their Jacobian in mm/px.
    pub(crate) fn apply(&self, pixel: [f64; 2]) -> ([f64; 2], Matrix2<f64>) {
        let (t, du, dv) = self.terms(pixel);
        let sum =
            |axis: usize, t: &[f64; TERMS]| -> f64 { (0..TERMS).map(|i| self.coefficients[axis][i] * t[i]).sum() };
        ([sum(0, &t), sum(1, &t)], Matrix2::new(sum(0, &du), sum(0, &dv), sum(1, &du), sum(1, &dv)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverts_perspective_and_lens_within_a_large_dot() {
        // Tilted by 45° at 300 mm, f = 477 px, k1 = −0.15.
        let forward = |p: [f64; 2]| {
            let z = 300.0 + 0.7 * p[0];
            let (x, y) = ((0.7 * p[0] + 60.0) / z, (p[1] + 40.0) / z);
            let k = 1.0 - 0.15 * (x * x + y * y);
            Some([477.0 * k * x + 313.0, 477.0 * k * y + 242.0])
        };
        let map = LocalMap::new(&forward, [30.0, 10.0], 12.0).expect("a map");
        for p in [[24.0, 10.0], [30.0, 16.0], [34.0, 6.0]] {
            let (b, jacobian) = map.apply(forward(p).expect("a pixel"));
            let error_px =
                jacobian.try_inverse().expect("invertible") * nalgebra::Vector2::new(b[0] - p[0], b[1] - p[1]);
            assert!(error_px.norm() < 1e-4, "{error_px}");
        }
    }

    #[test]
    fn undefined_mappings_are_refused() {
        assert!(LocalMap::new(&|_| None, [0.0, 0.0], 5.0).is_none());
        assert!(LocalMap::new(&|_| Some([3.0, 4.0]), [0.0, 0.0], 5.0).is_none());
    }
}
