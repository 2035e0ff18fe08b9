//! Homographies between the board and the image.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

/// A point and its image.
pub(crate) type Pair = ([f64; 2], [f64; 2]);

/// A projective map of the plane, here from board (mm) to image (px).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// The map with this matrix.
    pub fn new(matrix: Matrix3<f64>) -> Homography {
        Homography(matrix)
    }

    /// The matrix, of arbitrary scale.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.0
    }

    /// Fits the map to pairs (from, to) by the normalised direct linear transformation (Hartley 1997). `None` for fewer
    /// than four pairs, and when the points do not determine a map (collinear points).
    pub fn fit(pairs: &[([f64; 2], [f64; 2])]) -> Option<Homography> {
        if pairs.len() < 4 {
            return None;
        }
        let from = normalisation(pairs.iter().map(|p| p.0))?;
        let to = normalisation(pairs.iter().map(|p| p.1))?;
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (a, b) in pairs {
            let a = from * Vector3::new(a[0], a[1], 1.0);
            let b = to * Vector3::new(b[0], b[1], 1.0);
            let (x, y, u, v) = (a.x, a.y, b.x, b.y);
            for row in [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v]]
            {
                let row = SVector::<f64, 9>::from(row);
                normal.ger(1.0, &row, &row, 1.0);
            }
        }
        let eigen = normal.symmetric_eigen();
        let mut order: Vec<usize> = (0..9).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        // A second vanishing eigenvalue: the points do not determine the map.
        if eigen.eigenvalues[order[1]] < 1e-9 * eigen.eigenvalues[order[8]] {
            return None;
        }
        let h = eigen.eigenvectors.column(order[0]);
        let h = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
        let mut matrix = to.try_inverse()? * h * from;
        // Choose the sign for which points in front of the camera have a positive third coordinate.
        let first = pairs[0].0;
        if (matrix * Vector3::new(first[0], first[1], 1.0)).z < 0.0 {
            matrix = -matrix;
        }
        matrix.iter().all(|v| v.is_finite()).then(|| Homography(matrix / matrix.norm()))
    }

    /// Maps a point; `None` at and beyond the horizon.
    pub fn apply(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        let p = self.0 * Vector3::new(point[0], point[1], 1.0);
        (p.z > 1e-12).then(|| [p.x / p.z, p.y / p.z])
    }
}

/// Moves the centroid to the origin and scales the mean distance from it to √2.
fn normalisation(points: impl Iterator<Item = [f64; 2]> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let [x, y] = points.clone().fold([0.0, 0.0], |s, p| [s[0] + p[0] / n, s[1] + p[1] / n]);
    let spread = points.map(|p| (p[0] - x).hypot(p[1] - y)).sum::<f64>() / n;
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let k = std::f64::consts::SQRT_2 / spread;
    Some(Matrix3::new(k, 0.0, -k * x, 0.0, k, -k * y, 0.0, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_a_projective_map() {
        let truth = Homography(Matrix3::new(1.2, 0.1, 30.0, -0.2, 0.9, 40.0, 1e-3, -5e-4, 1.0));
        let pairs: Vec<_> = (0..20)
            .map(|i| {
                let p = [f64::from(i % 5) * 17.0, f64::from(i / 5) * 17.0];
                (p, truth.apply(p).expect("before the horizon"))
            })
            .collect();
        let fit = Homography::fit(&pairs).expect("a map");
        for (a, b) in &pairs {
            let c = fit.apply(*a).expect("before the horizon");
            assert!((c[0] - b[0]).hypot(c[1] - b[1]) < 1e-8);
        }
    }

    #[test]
    fn collinear_points_do_not_fix_it() {
        let pairs: Vec<_> = (0..9).map(|i| ([f64::from(i), 0.0], [f64::from(i) * 2.0, 3.0])).collect();
        assert!(Homography::fit(&pairs).is_none());
        assert!(Homography::fit(&pairs[..3]).is_none());
    }
}
