//! The pinhole parameters from homographies (Zhang 2000).

use depthcal_model::chain::PINHOLE;
use nalgebra::{DMatrix, Matrix3, Vector3};

use super::error::{PARALLEL_DEG, StartError};

/// Largest plausible distance of the principal point from the image's middle, as a share of the image's size.
const PRINCIPAL_POINT_PART: f64 = 0.25;

/// fx, fy, cx, cy, skew (px) by the closed form of Zhang 2000 with zero skew, from homographies that map the board (mm) to images
/// of `width` by `height` pixels. Where few or weakly tilted boards give an implausible principal point it is held in the
/// image's middle, and the focal lengths alone are solved for.
///
/// # Errors
///
/// [`StartError::NoFocalLength`].
pub fn pinhole_from_homographies(
    homographies: &[Matrix3<f64>],
    width: usize,
    height: usize,
) -> Result<[f64; PINHOLE], StartError> {
    let (w, h) = (width as f64, height as f64);
    let middle = [(w - 1.0) / 2.0, (h - 1.0) / 2.0];
    // Pixels in units of the image's size about its middle: the conic's coefficients are then of one magnitude.
    let scale = (w + h) / 2.0;
    let normalise =
        Matrix3::new(1.0 / scale, 0.0, -middle[0] / scale, 0.0, 1.0 / scale, -middle[1] / scale, 0.0, 0.0, 1.0);
    let normalised: Vec<Matrix3<f64>> = homographies.iter().map(|h| unit(normalise * h)).collect();
    let full = full_form(&normalised).filter(|[_, _, cx, cy]| {
        cx.abs() * scale < PRINCIPAL_POINT_PART * w && cy.abs() * scale < PRINCIPAL_POINT_PART * h
    });
    let [fx, fy, cx, cy] =
        full.or_else(|| focal_lengths(&normalised)).ok_or(StartError::NoFocalLength { frames: homographies.len() })?;
    Ok([fx * scale, fy * scale, cx * scale + middle[0], cy * scale + middle[1], 0.0])
}

fn unit(h: Matrix3<f64>) -> Matrix3<f64> {
    h / h.norm()
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

fn full_form(homographies: &[Matrix3<f64>]) -> Option<[f64; 4]> {
    let rows: Vec<f64> = homographies.iter().flat_map(constraints).flatten().collect();
    let v = DMatrix::from_row_slice(rows.len() / 5, 5, &rows);
    let eigen = (v.transpose() * &v).symmetric_eigen();
    let b = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let (b11, b22, b13, b23, b33) = (b[0], b[1], b[2], b[3], b[4]);
    let (cx, cy) = (-b13 / b11, -b23 / b22);
    let lambda = b33 - b13 * b13 / b11 - b23 * b23 / b22;
    let (fx2, fy2) = (lambda / b11, lambda / b22);
    (fx2 > 0.0 && fy2 > 0.0 && fx2.is_finite() && fy2.is_finite()).then(|| [fx2.sqrt(), fy2.sqrt(), cx, cy])
}

/// The focal lengths with the principal point held in the middle; a common focal length where two are not determined.
fn focal_lengths(homographies: &[Matrix3<f64>]) -> Option<[f64; 4]> {
    let (mut aa, mut ab, mut bb, mut ac, mut bc) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for [a, b, _, _, c] in homographies.iter().flat_map(constraints) {
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
/// parallel normals, and those of boards parallel to the image are exact.
///
/// # Errors
///
/// [`StartError::ParallelBoards`].
pub fn check_tilts(homographies: &[Matrix3<f64>], width: usize, height: usize) -> Result<(), StartError> {
    let f = 0.8 * width as f64;
    let k = Matrix3::new(f, 0.0, (width as f64 - 1.0) / 2.0, 0.0, f, (height as f64 - 1.0) / 2.0, 0.0, 0.0, 1.0);
    let Some(k_inverse) = k.try_inverse() else {
        return Err(StartError::NoFocalLength { frames: homographies.len() });
    };
    let normals: Vec<Vector3<f64>> = homographies
        .iter()
        .map(|h| {
            let m = k_inverse * h;
            let n = m.column(0).cross(&m.column(1)).normalize();
            if n.z < 0.0 { -n } else { n }
        })
        .collect();
    let angle = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b)).to_degrees();
    let pairs = normals.iter().enumerate().flat_map(|(i, a)| normals[..i].iter().map(move |b| angle(a, b)));
    let spread_deg = pairs.fold(0.0, f64::max);
    if spread_deg < PARALLEL_DEG {
        return Err(StartError::ParallelBoards { frames: homographies.len(), spread_deg });
    }
    Ok(())
}
