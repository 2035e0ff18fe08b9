//! Homographies from board to image.

use depthcal_model::Target;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector};

use super::error::{FEWEST_MARKERS, StartError};
use super::frame_markers::FrameMarkers;

/// Ratio of the narrow to the wide extent of the markers below which they count as collinear.
const COLLINEAR: f64 = 1e-3;

/// The homography that maps board coordinates (mm, homogeneous) to pixels, by the normalised direct linear transform
/// (Hartley, Zisserman 2004, algorithm 4.2), refined on the pixel distances by Gauss–Newton.
///
/// # Errors
///
/// [`StartError::TooFewMarkers`], [`StartError::Collinear`].
pub fn homography(target: &Target, frame: &FrameMarkers<'_>) -> Result<Matrix3<f64>, StartError> {
    let found = frame.markers.len();
    if found < FEWEST_MARKERS {
        return Err(StartError::TooFewMarkers { frame: frame.name.to_owned(), found, needed: FEWEST_MARKERS });
    }
    let board: Vec<[f64; 2]> = frame.markers.iter().map(|m| target.point(m.index)).collect();
    let image: Vec<[f64; 2]> = frame.markers.iter().map(|m| m.pixel).collect();
    if flatness(&board) < COLLINEAR || flatness(&image) < COLLINEAR {
        return Err(StartError::Collinear { frame: frame.name.to_owned() });
    }
    let (to_board, to_image) = (normaliser(&board), normaliser(&image));
    let apply = |n: &Matrix3<f64>, p: &[f64; 2]| [n.m11 * p[0] + n.m13, n.m22 * p[1] + n.m23];
    let board_n: Vec<[f64; 2]> = board.iter().map(|p| apply(&to_board, p)).collect();
    let image_n: Vec<[f64; 2]> = image.iter().map(|p| apply(&to_image, p)).collect();
    let mut rows = DMatrix::zeros(2 * found, 9);
    for (k, ([x, y], [u, v])) in board_n.iter().zip(&image_n).enumerate() {
        rows.row_mut(2 * k).copy_from_slice(&[*x, *y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u]);
        rows.row_mut(2 * k + 1).copy_from_slice(&[0.0, 0.0, 0.0, *x, *y, 1.0, -v * x, -v * y, -v]);
    }
    let eigen = (rows.transpose() * &rows).symmetric_eigen();
    let h = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let mut h = Matrix3::from_row_iterator(h.iter().copied());
    h /= h.m33;
    for _ in 0..10 {
        let step = gauss_newton_step(&h, &board_n, &image_n);
        let Some(step) = step else { break };
        for i in 0..8 {
            h[(i / 3, i % 3)] += step[i];
        }
        if step.amax() < 1e-12 {
            break;
        }
    }
    let invert = |n: &Matrix3<f64>| {
        Matrix3::new(1.0 / n.m11, 0.0, -n.m13 / n.m11, 0.0, 1.0 / n.m22, -n.m23 / n.m22, 0.0, 0.0, 1.0)
    };
    let h = invert(&to_image) * h * to_board;
    Ok(h / h.norm())
}

/// Step of the first eight coefficients, the ninth being 1; `None` where the points do not determine it.
fn gauss_newton_step(h: &Matrix3<f64>, board: &[[f64; 2]], image: &[[f64; 2]]) -> Option<SVector<f64, 8>> {
    let (mut normal, mut rhs) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
    for ([x, y], [u, v]) in board.iter().zip(image) {
        let w = h.m31 * x + h.m32 * y + h.m33;
        let (pu, pv) = ((h.m11 * x + h.m12 * y + h.m13) / w, (h.m21 * x + h.m22 * y + h.m23) / w);
        let (a, b, c) = (x / w, y / w, 1.0 / w);
        let ju = SVector::<f64, 8>::from([a, b, c, 0.0, 0.0, 0.0, -pu * a, -pu * b]);
        let jv = SVector::<f64, 8>::from([0.0, 0.0, 0.0, a, b, c, -pv * a, -pv * b]);
        normal += ju * ju.transpose() + jv * jv.transpose();
        rhs += ju * (u - pu) + jv * (v - pv);
    }
    normal.cholesky().map(|c| c.solve(&rhs))
}

/// Smaller over larger extent of points: the ratio of the roots of their scatter matrix' eigenvalues.
fn flatness(points: &[[f64; 2]]) -> f64 {
    let n = points.len() as f64;
    let mean = points.iter().fold([0.0; 2], |m, p| [m[0] + p[0] / n, m[1] + p[1] / n]);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = [p[0] - mean[0], p[1] - mean[1]];
        xx += d[0] * d[0];
        xy += d[0] * d[1];
        yy += d[1] * d[1];
    }
    let (half, root) = ((xx + yy) / 2.0, (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt());
    if half + root > 0.0 { ((half - root).max(0.0) / (half + root)).sqrt() } else { 0.0 }
}

/// The similarity that moves the centroid to the origin and scales the mean distance from it to √2.
fn normaliser(points: &[[f64; 2]]) -> Matrix3<f64> {
    let n = points.len() as f64;
    let mean = points.iter().fold([0.0; 2], |m, p| [m[0] + p[0] / n, m[1] + p[1] / n]);
    let distance = points.iter().map(|p| (p[0] - mean[0]).hypot(p[1] - mean[1])).sum::<f64>() / n;
    let s = std::f64::consts::SQRT_2 / distance;
    Matrix3::new(s, 0.0, -s * mean[0], 0.0, s, -s * mean[1], 0.0, 0.0, 1.0)
}
