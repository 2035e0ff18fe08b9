//! Nonlinear least squares on distances in space.

use nalgebra::{DMatrix, DVector, Vector3, Vector4};

use super::error::{EstimatorError, free_names};
use super::linear::linear;
use super::marker_points::MarkerPoint;

/// D that minimises the squared distances between the markers' defined positions and their back-projections
/// E⁻¹D⁻¹K⁻¹x̂ (thesis eq. 4.18), by Gauss–Newton from the linear solution with halved steps where the cost rises.
///
/// # Errors
///
/// Those of [`linear`].
pub fn nonlinear(points: &[MarkerPoint], free: [bool; 4]) -> Result<Vector4<f64>, EstimatorError> {
    let mut d = linear(points, free)?;
    let columns: Vec<usize> = (0..4).filter(|i| free[*i]).collect();
    if columns.is_empty() {
        return Ok(d);
    }
    let cost = |d: &Vector4<f64>| {
        points.iter().map(|p| (back_project(p, d).0 - p.point_in_camera).norm_squared()).sum::<f64>()
    };
    let mut best = cost(&d);
    for _ in 0..100 {
        let m = columns.len();
        let (mut normal, mut rhs) = (DMatrix::zeros(m, m), DVector::zeros(m));
        for p in points {
            let (x, gradient) = back_project(p, &d);
            let direction = Vector3::new(p.ray[0], p.ray[1], 1.0);
            let along = direction.dot(&(p.point_in_camera - x));
            let g = DVector::from_fn(m, |c, _| gradient[columns[c]]);
            normal += &g * g.transpose() * direction.norm_squared();
            rhs += g * along;
        }
        let scale = DVector::from_fn(m, |c, _| 1.0 / normal[(c, c)].sqrt());
        let scaled = DMatrix::from_fn(m, m, |r, c| normal[(r, c)] * scale[r] * scale[c]);
        let Some(factor) = scaled.cholesky() else {
            return Err(EstimatorError::Degenerate { free: free_names(free) });
        };
        let step = factor.solve(&rhs.component_mul(&scale)).component_mul(&scale);
        let mut part = 1.0;
        let mut moved = d;
        while part > 1e-6 {
            moved = d;
            for (c, i) in columns.iter().enumerate() {
                moved[*i] += part * step[c];
            }
            if cost(&moved) <= best {
                break;
            }
            part *= 0.5;
        }
        let next = cost(&moved);
        if !(next < best) {
            break;
        }
        let gain = best - next;
        (d, best) = (moved, next);
        if gain < 1e-14 * best {
            break;
        }
    }
    Ok(d)
}

/// A marker's back-projection in the camera frame (mm), z (x, y, 1) with 1/z = (ρ_m − dx x − dy y − dz) / dw, and ∂z/∂d.
fn back_project(p: &MarkerPoint, d: &Vector4<f64>) -> (Vector3<f64>, Vector4<f64>) {
    let [x, y] = p.ray;
    let difference = p.inverse_depth - d[0] * x - d[1] * y - d[2];
    let z = d[3] / difference;
    (Vector3::new(x * z, y * z, z), Vector4::new(x * z, y * z, z, 1.0) / difference)
}
