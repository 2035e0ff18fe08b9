//! Homographies from board to image.

use depthcal_model::Target;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector};

use super::error::{FEWEST_MARKERS, StartError};
use super::frame_markers::FrameMarkers;

/// Ratio of the narrow to the wide extent of the markers below which they count as collinear.
const COLLINEAR: f64 = 1e-3;

/// A homography with what its markers say of its precision.
#[derive(Debug, Clone)]
pub struct HomographyFit {
    /// Maps board coordinates (mm, homogeneous) to pixels; of unit norm.
    pub matrix: Matrix3<f64>,
    /// A square root of its covariance where markers have a standard deviation of 1 px per coordinate: the covariance of the
    /// matrix' elements is Σₖ vec(Sₖ) vec(Sₖ)ᵀ, to first order (Hartley, Zisserman 2004, section 5.2).
    pub deviations: [Matrix3<f64>; 8],
    /// Root mean square of the distances that are left, per coordinate and degree of freedom, px. Lens distortion is part of
    /// it.
    pub rms_px: f64,
}

/// The homography that maps board coordinates (mm, homogeneous) to pixels, by the normalised direct linear transform
/// (Hartley, Zisserman 2004, algorithm 4.2), refined on the pixel distances by Gauss–Newton.
///
/// # Errors
///
/// [`StartError::TooFewMarkers`], [`StartError::Collinear`].
pub fn homography(target: &Target, frame: &FrameMarkers<'_>) -> Result<Matrix3<f64>, StartError> {
    Ok(fit_homography(target, frame)?.matrix)
}

/// [`homography`] with its precision. Markers all but one of which lie on a line leave it undetermined as well.
///
/// # Errors
///
/// [`StartError::TooFewMarkers`], [`StartError::Collinear`].
pub fn fit_homography(target: &Target, frame: &FrameMarkers<'_>) -> Result<HomographyFit, StartError> {
    let count = frame.markers.len();
    if count < FEWEST_MARKERS {
        return Err(StartError::TooFewMarkers { frame: frame.name.to_owned(), found: count, needed: FEWEST_MARKERS });
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
    let mut rows = DMatrix::zeros(2 * count, 9);
    for (k, ([x, y], [u, v])) in board_n.iter().zip(&image_n).enumerate() {
        rows.row_mut(2 * k).copy_from_slice(&[*x, *y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u]);
        rows.row_mut(2 * k + 1).copy_from_slice(&[0.0, 0.0, 0.0, *x, *y, 1.0, -v * x, -v * y, -v]);
    }
    let eigen = (rows.transpose() * &rows).symmetric_eigen();
    let h = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let mut h = Matrix3::from_row_iterator(h.iter().copied());
    h /= h.m33;
    for _ in 0..10 {
        let Some(step) = linearized(&h, &board_n, &image_n).step() else { break };
        for i in 0..8 {
            h[(i / 3, i % 3)] += step[i];
        }
        if step.amax() < 1e-12 {
            break;
        }
    }
    let last = linearized(&h, &board_n, &image_n);
    let undetermined = || StartError::Collinear { frame: frame.name.to_owned() };
    let factor = last.normal.cholesky().ok_or_else(undetermined)?.l();
    // N = L Lᵀ, so that the columns of L⁻ᵀ are a square root of N⁻¹.
    let root = factor.try_inverse().ok_or_else(undetermined)?.transpose();
    let invert = |n: &Matrix3<f64>| {
        Matrix3::new(1.0 / n.m11, 0.0, -n.m13 / n.m11, 0.0, 1.0 / n.m22, -n.m23 / n.m22, 0.0, 0.0, 1.0)
    };
    let from_normalised = |h: Matrix3<f64>| invert(&to_image) * h * to_board;
    let matrix = from_normalised(h);
    let norm = matrix.norm();
    // A pixel is `to_image.m11` in normalised coordinates.
    let deviations = std::array::from_fn(|k| {
        let change = Matrix3::from_fn(|r, c| if (r, c) == (2, 2) { 0.0 } else { root[(3 * r + c, k)] });
        from_normalised(change) * (to_image.m11 / norm)
    });
    let freedom = (2 * count - 8) as f64;
    Ok(HomographyFit { matrix: matrix / norm, deviations, rms_px: (last.cost / freedom).sqrt() / to_image.m11 })
}

/// Normal equations of the first eight coefficients, the ninth being 1.
struct Linearized {
    normal: SMatrix<f64, 8, 8>,
    rhs: SVector<f64, 8>,
    cost: f64,
}

impl Linearized {
    /// The step of Gauss and Newton; `None` where the points do not determine it.
    fn step(&self) -> Option<SVector<f64, 8>> {
        self.normal.cholesky().map(|c| c.solve(&self.rhs))
    }
}

fn linearized(h: &Matrix3<f64>, board: &[[f64; 2]], image: &[[f64; 2]]) -> Linearized {
    let (mut normal, mut rhs, mut cost) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros(), 0.0);
    for ([x, y], [u, v]) in board.iter().zip(image) {
        let w = h.m31 * x + h.m32 * y + h.m33;
        let (pu, pv) = ((h.m11 * x + h.m12 * y + h.m13) / w, (h.m21 * x + h.m22 * y + h.m23) / w);
        let (a, b, c) = (x / w, y / w, 1.0 / w);
        let ju = SVector::<f64, 8>::from([a, b, c, 0.0, 0.0, 0.0, -pu * a, -pu * b]);
        let jv = SVector::<f64, 8>::from([0.0, 0.0, 0.0, a, b, c, -pv * a, -pv * b]);
        normal += ju * ju.transpose() + jv * jv.transpose();
        rhs += ju * (u - pu) + jv * (v - pv);
        cost += (u - pu).powi(2) + (v - pv).powi(2);
    }
    Linearized { normal, rhs, cost }
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
