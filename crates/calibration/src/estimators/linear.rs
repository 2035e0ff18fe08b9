//! Linear and iteratively reweighted least squares.

use nalgebra::{DMatrix, DVector, Vector4};

use super::error::{EstimatorError, free_names};
use super::marker_points::{MarkerPoint, nominal};

/// Regularisation of the weights 1 / max(δ, |residual|), thesis eq. 4.17.
const DELTA: f64 = 1e-4;
/// Reciprocal condition number (columns scaled to unit length) below which D counts as undetermined.
const LEAST_CONDITION: f64 = 1e-8;

/// The thesis' equation per point, XᵀC d = (X̃₄ / X̃₃) Z with X_C = (X, Y, Z, 1) and X̃₄ / X̃₃ the measured inverse depth:
/// one row of the system, and its right side (eq. 4.12).
fn equation(p: &MarkerPoint) -> (Vector4<f64>, f64) {
    (p.point_in_camera.push(1.0), p.inverse_depth * p.point_in_camera.z)
}

/// D by linear least squares (eq. 4.14); parameters that are not free stay nominal.
///
/// # Errors
///
/// [`EstimatorError::TooFewPoints`], [`EstimatorError::Degenerate`].
pub fn linear(points: &[MarkerPoint], free: [bool; 4]) -> Result<Vector4<f64>, EstimatorError> {
    weighted(points, free, &vec![1.0; points.len()])
}

/// D by iteratively reweighted least squares, an L1 norm (eq. 4.16, 4.17).
///
/// # Errors
///
/// Those of [`linear`].
pub fn irls(points: &[MarkerPoint], free: [bool; 4]) -> Result<Vector4<f64>, EstimatorError> {
    let mut d = linear(points, free)?;
    for _ in 0..100 {
        let weights: Vec<f64> = points
            .iter()
            .map(|p| {
                let (row, y) = equation(p);
                1.0 / (row.dot(&d) - y).abs().max(DELTA)
            })
            .collect();
        let next = weighted(points, free, &weights)?;
        let change = (next - d).component_div(&Vector4::new(1e-4, 1e-4, 1e-4, 1.0)).amax();
        d = next;
        if change < 1e-10 {
            break;
        }
    }
    Ok(d)
}

fn weighted(points: &[MarkerPoint], free: [bool; 4], weights: &[f64]) -> Result<Vector4<f64>, EstimatorError> {
    let columns: Vec<usize> = (0..4).filter(|i| free[*i]).collect();
    let mut d = nominal();
    if columns.is_empty() {
        return Ok(d);
    }
    if points.len() < columns.len() {
        return Err(EstimatorError::TooFewPoints { found: points.len(), needed: columns.len() });
    }
    let held = Vector4::from_fn(|i, _| if free[i] { 0.0 } else { d[i] });
    let mut a = DMatrix::zeros(points.len(), columns.len());
    let mut y = DVector::zeros(points.len());
    for (k, (p, w)) in points.iter().zip(weights).enumerate() {
        let (row, right) = equation(p);
        for (c, i) in columns.iter().enumerate() {
            a[(k, c)] = w.sqrt() * row[*i];
        }
        y[k] = w.sqrt() * (right - row.dot(&held));
    }
    let scales: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
    for (mut column, scale) in a.column_iter_mut().zip(&scales) {
        column /= *scale;
    }
    let svd = a.svd(true, true);
    let degenerate = || EstimatorError::Degenerate { free: free_names(free) };
    let (most, least) = (svd.singular_values.max(), svd.singular_values.min());
    if !(least > LEAST_CONDITION * most) {
        return Err(degenerate());
    }
    let solution = svd.solve(&y, 0.0).map_err(|_| degenerate())?;
    for (c, i) in columns.iter().enumerate() {
        d[*i] = solution[c] / scales[c];
    }
    Ok(d)
}
