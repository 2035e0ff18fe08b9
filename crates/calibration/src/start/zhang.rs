//! The pinhole parameters from homographies (Zhang 2000).

use depthcal_model::chain::PINHOLE;
use depthcal_statistics::upper_median;
use nalgebra::{DMatrix, Matrix3, Vector3};

use super::error::{PARALLEL_DEG, StartError};
use super::homography::HomographyFit;

/// Largest plausible distance of the principal point from the image's middle, as a share of the image's size.
const PRINCIPAL_POINT_PART: f64 = 0.25;

/// Focal length in image widths that is assumed before it is known.
const ASSUMED_FOCAL_LENGTH: f64 = 0.8;
/// Solutions of the closed form, each but the first with the weights of the one before.
const WEIGHTED_ROUNDS: usize = 3;
/// Markers are never taken for more precise than this, px: simulated ones may be exact.
const LEAST_SIGMA_PX: f64 = 1e-3;
/// Smallest variance of a constraint, as a share of the median constraint's: homographies err by the lens too, which their
/// covariances do not know.
const LEAST_VARIANCE: f64 = 0.04;
/// Normals whose standard deviation is larger than this do not show that boards are tilted, degrees.
const UNCERTAIN_NORMAL_DEG: f64 = 0.5 * PARALLEL_DEG;

/// fx, fy, cx, cy, skew (px) by the closed form of Zhang 2000 with zero skew, from homographies that map the board (mm) to images
/// of `width` by `height` pixels. Where few or weakly tilted boards give an implausible principal point it is held in the
/// image's middle, and the focal lengths alone are solved for.
///
/// The constraints of a homography are divided by their standard deviations, which follow from its covariance (iteratively
/// reweighted, as Hartley and Zisserman 2004, section 4.2.5, do for the direct linear transform): frames with few or crowded
/// markers, or with wrong ones, hardly count.
///
/// # Errors
///
/// [`StartError::NoFocalLength`].
pub fn pinhole_from_homographies(
    homographies: &[HomographyFit],
    width: usize,
    height: usize,
) -> Result<[f64; PINHOLE], StartError> {
    let (w, h) = (width as f64, height as f64);
    let middle = [(w - 1.0) / 2.0, (h - 1.0) / 2.0];
    // Pixels in units of the image's size about its middle: the conic's coefficients are then of one magnitude.
    let scale = (w + h) / 2.0;
    let normalise =
        Matrix3::new(1.0 / scale, 0.0, -middle[0] / scale, 0.0, 1.0 / scale, -middle[1] / scale, 0.0, 0.0, 1.0);
    let sigmas = marker_sigmas(homographies);
    let views: Vec<View> = homographies.iter().zip(&sigmas).map(|(h, s)| View::new(h, *s, &normalise)).collect();
    let assumed = ASSUMED_FOCAL_LENGTH * w / scale;
    let (mut pinhole, mut solved) = ([assumed, assumed, 0.0, 0.0], None);
    for _ in 0..WEIGHTED_ROUNDS {
        let rows = weighted_constraints(&views, pinhole);
        let full = full_form(&rows).filter(|[_, _, cx, cy]| {
            cx.abs() * scale < PRINCIPAL_POINT_PART * w && cy.abs() * scale < PRINCIPAL_POINT_PART * h
        });
        let Some(next) = full.or_else(|| focal_lengths(&rows)) else { break };
        (pinhole, solved) = (next, Some(next));
    }
    let [fx, fy, cx, cy] = solved.ok_or(StartError::NoFocalLength { frames: homographies.len() })?;
    Ok([fx * scale, fy * scale, cx * scale + middle[0], cy * scale + middle[1], 0.0])
}

/// Standard deviation of the markers of each frame, px: what its homography leaves, but not less than in the median frame,
/// because few markers leave little.
fn marker_sigmas(homographies: &[HomographyFit]) -> Vec<f64> {
    let mut all: Vec<f64> = homographies.iter().map(|h| h.rms_px).collect();
    let least = upper_median(&mut all).unwrap_or_default().max(LEAST_SIGMA_PX);
    homographies.iter().map(|h| h.rms_px.max(least)).collect()
}

/// A homography in normalised pixels, of unit norm, with its deviations.
struct View {
    matrix: Matrix3<f64>,
    deviations: [Matrix3<f64>; 8],
}

impl View {
    fn new(fit: &HomographyFit, sigma_px: f64, normalise: &Matrix3<f64>) -> Self {
        let matrix = normalise * fit.matrix;
        let norm = matrix.norm();
        Self { matrix: matrix / norm, deviations: fit.deviations.map(|d| normalise * d * (sigma_px / norm)) }
    }

    /// Its two constraints, and their variances under the conic `b`.
    fn constraints(&self, b: &[f64; 5]) -> [([f64; 5], f64); 2] {
        let values = |h: &Matrix3<f64>| constraints(h).map(|c| c.iter().zip(b).map(|(c, b)| c * b).sum::<f64>());
        // The constraints are quadratic in H: their central differences are exact.
        let changes = self.deviations.map(|d| {
            let (plus, minus) = (values(&(self.matrix + d)), values(&(self.matrix - d)));
            [0, 1].map(|i| 0.5 * (plus[i] - minus[i]))
        });
        let variance = [0, 1].map(|i| changes.iter().map(|c| c[i] * c[i]).sum::<f64>());
        let rows = constraints(&self.matrix);
        [0, 1].map(|i| (rows[i], variance[i]))
    }
}

/// All constraints, divided by their standard deviations under the pinhole fx, fy, cx, cy.
fn weighted_constraints(views: &[View], [fx, fy, cx, cy]: [f64; 4]) -> Vec<[f64; 5]> {
    let (a, b) = (1.0 / (fx * fx), 1.0 / (fy * fy));
    let conic = [a, b, -cx * a, -cy * b, 1.0 + cx * cx * a + cy * cy * b];
    let all: Vec<([f64; 5], f64)> = views.iter().flat_map(|v| v.constraints(&conic)).collect();
    let mut variances: Vec<f64> = all.iter().map(|c| c.1).collect();
    let least = LEAST_VARIANCE * upper_median(&mut variances).unwrap_or_default();
    all.iter()
        .map(|(row, variance)| {
            let weight = 1.0 / variance.max(least).max(f64::MIN_POSITIVE).sqrt();
            row.map(|x| x * weight)
        })
        .collect()
}

/// Zhang's v_ij for a conic without skew: coefficients of (B11, B22, B13, B23, B33) in hᵢᵀ B hⱼ.
fn constraint(h: &Matrix3<f64>, i: usize, j: usize) -> [f64; 5] {
    let (a, b) = (h.column(i), h.column(j));
    [a[0] * b[0], a[1] * b[1], a[0] * b[2] + a[2] * b[0], a[1] * b[2] + a[2] * b[1], a[2] * b[2]]
}

/// Both of a view's constraints: h₁ᵀ B h₂ = 0 and h₁ᵀ B h₁ = h₂ᵀ B h₂.
fn constraints(h: &Matrix3<f64>) -> [[f64; 5]; 2] {
    let (v11, v22) = (constraint(h, 0, 0), constraint(h, 1, 1));
    [constraint(h, 0, 1), std::array::from_fn(|i| v11[i] - v22[i])]
}

fn full_form(constraints: &[[f64; 5]]) -> Option<[f64; 4]> {
    let v = DMatrix::from_row_slice(constraints.len(), 5, constraints.as_flattened());
    let eigen = (v.transpose() * &v).symmetric_eigen();
    let b = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let (b11, b22, b13, b23, b33) = (b[0], b[1], b[2], b[3], b[4]);
    let (cx, cy) = (-b13 / b11, -b23 / b22);
    let lambda = b33 - b13 * b13 / b11 - b23 * b23 / b22;
    let (fx2, fy2) = (lambda / b11, lambda / b22);
    (fx2 > 0.0 && fy2 > 0.0 && fx2.is_finite() && fy2.is_finite()).then(|| [fx2.sqrt(), fy2.sqrt(), cx, cy])
}

/// The focal lengths with the principal point held in the middle; a common focal length where two are not determined.
fn focal_lengths(constraints: &[[f64; 5]]) -> Option<[f64; 4]> {
    let (mut aa, mut ab, mut bb, mut ac, mut bc) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for [a, b, _, _, c] in constraints {
        aa += a * a;
        ab += a * b;
        bb += b * b;
        ac -= a * c;
        bc -= b * c;
    }
    let det = aa * bb - ab * ab;
    let (x, y) = ((ac * bb - bc * ab) / det, (aa * bc - ab * ac) / det);
    if x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite() {
        return Some([(1.0 / x).sqrt(), (1.0 / y).sqrt(), 0.0, 0.0]);
    }
    let common = (ac + bc) / (aa + 2.0 * ab + bb);
    (common > 0.0 && common.is_finite()).then(|| [(1.0 / common).sqrt(), (1.0 / common).sqrt(), 0.0, 0.0])
}

/// Refuses captures whose boards are all parallel: they determine neither the focal length nor the principal point.
///
/// The normals are computed with an assumed focal length of 0.8 image widths. Whatever the true one, parallel boards have
/// parallel normals, and those of boards parallel to the image are exact. Boards whose markers leave the normal uncertain do
/// not count, unless all are.
///
/// # Errors
///
/// [`StartError::ParallelBoards`].
pub fn check_tilts(homographies: &[HomographyFit], width: usize, height: usize) -> Result<(), StartError> {
    let f = ASSUMED_FOCAL_LENGTH * width as f64;
    let k = Matrix3::new(f, 0.0, (width as f64 - 1.0) / 2.0, 0.0, f, (height as f64 - 1.0) / 2.0, 0.0, 0.0, 1.0);
    let Some(k_inverse) = k.try_inverse() else {
        return Err(StartError::NoFocalLength { frames: homographies.len() });
    };
    let normal = |h: &Matrix3<f64>| {
        let m = k_inverse * h;
        let n: Vector3<f64> = m.column(0).cross(&m.column(1)).normalize();
        if n.z < 0.0 { -n } else { n }
    };
    let angle = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b)).to_degrees();
    let normals: Vec<(Vector3<f64>, f64)> = homographies
        .iter()
        .zip(marker_sigmas(homographies))
        .map(|(h, sigma)| {
            let n = normal(&h.matrix);
            let moved = h.deviations.iter().map(|d| angle(&n, &normal(&(h.matrix + d * sigma))).powi(2));
            (n, moved.sum::<f64>().sqrt())
        })
        .collect();
    let certain: Vec<Vector3<f64>> = normals.iter().filter(|n| n.1 < UNCERTAIN_NORMAL_DEG).map(|n| n.0).collect();
    let looked_at = if certain.len() < 2 { normals.iter().map(|n| n.0).collect() } else { certain };
    let pairs = looked_at.iter().enumerate().flat_map(|(i, a)| looked_at[..i].iter().map(move |b| angle(a, b)));
    let spread_deg = pairs.fold(0.0, f64::max);
    if spread_deg < PARALLEL_DEG {
        return Err(StartError::ParallelBoards { frames: homographies.len(), spread_deg });
    }
    Ok(())
}
