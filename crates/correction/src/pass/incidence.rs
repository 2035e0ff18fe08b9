//! The angle of incidence from a depth image.

use rayon::prelude::*;

/// Half the side of the window that a plane is fitted to, px.
const REACH: usize = 4;
/// Share by which the inverse depth of two pixels on the same surface may differ.
const SAME_SURFACE: f64 = 0.05;
/// Fewest pixels of the window on the same surface that a plane is fitted to.
const FEWEST: usize = 12;
/// Smallest cosine (84°): steeper surfaces are taken to be this steep.
const STEEPEST: f64 = 0.1;

/// Cosine of the angle between ray and surface normal at every pixel; 1 where there is no depth, or too little around
/// the pixel to determine the surface.
///
/// The inverse depth of a plane is affine in the ray, ρ = α x + β y + γ, and its normal is (α, β, γ). The plane is
/// fitted to the window around the pixel by least squares; the cosine is ρ / (|(α, β, γ)| |(x, y, 1)|).
pub(crate) fn cosines(width: usize, depth_mm: &[f32], ray: impl Fn(usize, f64) -> [f64; 2] + Sync) -> Vec<f32> {
    // Ray and inverse depth of every pixel; NaN without depth, which makes the comparison below false.
    let pixels: Vec<[f64; 3]> = depth_mm
        .par_iter()
        .enumerate()
        .map(|(index, z)| {
            let rho = if *z > 0.0 { 1.0 / f64::from(*z) } else { f64::NAN };
            let [x, y] = if rho.is_nan() { [f64::NAN; 2] } else { ray(index, rho) };
            [x, y, rho]
        })
        .collect();
    (0..pixels.len()).into_par_iter().map(|index| cosine(width, &pixels, index).unwrap_or(1.0) as f32).collect()
}

/// The cosine at one pixel, given x, y, ρ of all pixels; `None` where it cannot be determined.
fn cosine(width: usize, pixels: &[[f64; 3]], index: usize) -> Option<f64> {
    let height = pixels.len() / width;
    let [x0, y0, rho0] = pixels[index];
    if !(x0.is_finite() && rho0.is_finite()) {
        return None;
    }
    let (column, row) = (index % width, index / width);
    let columns = column.saturating_sub(REACH)..(column + REACH + 1).min(width);
    let rows = row.saturating_sub(REACH)..(row + REACH + 1).min(height);
    let (mut n, mut sum, mut xx, mut xy, mut yy, mut xr, mut yr) = (0, [0.0; 3], 0.0, 0.0, 0.0, 0.0, 0.0);
    for row in rows {
        for [x, y, rho] in &pixels[row * width + columns.start..row * width + columns.end] {
            // Relative to the pixel itself, so that the sums of squares do not cancel.
            let (dx, dy, dr) = (x - x0, y - y0, rho - rho0);
            if !(dr.abs() <= SAME_SURFACE * rho0) {
                continue;
            }
            n += 1;
            sum = [sum[0] + dx, sum[1] + dy, sum[2] + dr];
            (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
            (xr, yr) = (xr + dx * dr, yr + dy * dr);
        }
    }
    if n < FEWEST {
        return None;
    }
    let mean = sum.map(|s| s / n as f64);
    let central = |product: f64, i: usize, j: usize| product - n as f64 * mean[i] * mean[j];
    let (xx, xy, yy) = (central(xx, 0, 0), central(xy, 0, 1), central(yy, 1, 1));
    let (xr, yr) = (central(xr, 0, 2), central(yr, 1, 2));
    let det = xx * yy - xy * xy;
    if !(det > 1e-6 * xx * yy) {
        return None;
    }
    let (alpha, beta) = ((yy * xr - xy * yr) / det, (xx * yr - xy * xr) / det);
    let rho = rho0 + mean[2] - alpha * mean[0] - beta * mean[1];
    let gamma = rho - alpha * x0 - beta * y0;
    let normal = (alpha * alpha + beta * beta + gamma * gamma).sqrt();
    let cosine = rho / (normal * (1.0 + x0 * x0 + y0 * y0).sqrt());
    cosine.is_finite().then(|| cosine.clamp(STEEPEST, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window of a plane in which only the first `n` pixels have depth, the one that is asked for among them.
    #[test]
    fn a_plane_needs_its_fewest_pixels() {
        let cosine_of = |n: usize| {
            let pixels: Vec<[f64; 3]> = (0..25)
                .map(|i| {
                    let (x, y) = ((i % 5) as f64 * 0.01, (i / 5) as f64 * 0.01);
                    if i < n { [x, y, 1e-3 * (1.0 + 0.5 * x)] } else { [f64::NAN; 3] }
                })
                .collect();
            cosine(5, &pixels, 0)
        };
        // ρ = α x + γ at x = y = 0: γ / |(α, γ)|.
        let expected = 1.0 / 1.25f64.sqrt();
        assert_eq!(cosine_of(FEWEST - 1), None);
        assert!((cosine_of(FEWEST).unwrap() - expected).abs() < 1e-9);
    }
}
