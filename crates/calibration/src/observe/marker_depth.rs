//! Depth at markers, interpolated from a plane that is fitted to the depth around each marker.

use depthcal_model::Target;
use nalgebra::{Matrix3, Vector3};

use super::board_region::BoardPixel;

/// Radius around a marker within which pixels support its plane, in distances between neighbouring markers.
const SUPPORT: f64 = 1.1;
/// Fewest supporting pixels.
const FEWEST_PIXELS: usize = 12;
/// Residuals beyond this many robust standard deviations are excluded from the fit.
const GATE: f64 = 3.5;

/// Measured inverse depth (1/mm) at every marker (index and ray), interpolated from an affine function of the ray, which is
/// exact for planes, that is fitted robustly to the board pixels around the marker. `None` where too few pixels are valid or
/// where they lie on one side of the marker only.
pub fn marker_inverse_depths(
    target: &Target,
    markers: &[(usize, [f64; 2])],
    pixels: &[BoardPixel],
) -> Vec<Option<f64>> {
    let radius = SUPPORT * nearest_distance(target);
    markers
        .iter()
        .map(|(index, ray)| {
            let p = target.point(*index);
            let near: Vec<&BoardPixel> =
                pixels.iter().filter(|q| (q.board[0] - p[0]).hypot(q.board[1] - p[1]) <= radius).collect();
            plane_at(*ray, &near)
        })
        .collect()
}

/// Smallest distance between two markers, mm.
fn nearest_distance(target: &Target) -> f64 {
    let points = target.points();
    let first = points.first().copied().unwrap_or([0.0; 2]);
    let others = points.iter().skip(1).map(|p| (p[0] - first[0]).hypot(p[1] - first[1]));
    others.fold(f64::INFINITY, f64::min)
}

fn plane_at(ray: [f64; 2], pixels: &[&BoardPixel]) -> Option<f64> {
    let mut kept: Vec<&BoardPixel> = pixels.to_vec();
    let mut value = None;
    for _ in 0..5 {
        if kept.len() < FEWEST_PIXELS {
            return None;
        }
        // Coordinates are relative to the marker: the constant of the plane is the value at the marker.
        let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
        for q in &kept {
            let row = Vector3::new(q.ray[0] - ray[0], q.ray[1] - ray[1], 1.0);
            normal += row * row.transpose();
            rhs += row / q.depth_mm;
        }
        // A marker outside its supporting pixels would be extrapolated, which the variance of the constant shows.
        let inverse = normal.try_inverse()?;
        if inverse.m33 * kept.len() as f64 > 4.0 {
            return None;
        }
        let plane = inverse * rhs;
        value = Some(plane.z).filter(|v| v.is_finite() && *v > 0.0);
        let residual = |q: &BoardPixel| {
            let at = plane.x * (q.ray[0] - ray[0]) + plane.y * (q.ray[1] - ray[1]) + plane.z;
            (1.0 / q.depth_mm - at).abs()
        };
        let mut sizes: Vec<f64> = kept.iter().map(|q| residual(q)).collect();
        sizes.sort_by(f64::total_cmp);
        let sigma = 1.4826 * sizes[sizes.len() / 2];
        let before = kept.len();
        kept.retain(|q| residual(q) <= GATE * sigma);
        if kept.len() == before || sigma == 0.0 {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use depthcal_model::{Context, Pattern};

    /// A tilted plane with a hole at the marker and gross outliers: the plane's value there comes back exactly.
    #[test]
    fn a_plane_is_interpolated_through_a_hole_despite_outliers() {
        let target = Target {
            pattern: Pattern::SymmetricCircles { circle_diameter_mm: 8.0 },
            columns: 3,
            rows: 3,
            spacing_mm: 30.0,
        };
        let plane = |x: f64, y: f64| 2e-4 * x - 1e-4 * y + 1.25e-3;
        let mut pixels = Vec::new();
        for i in -20..=20_i32 {
            for j in -20..=20_i32 {
                let board = [30.0 + 1.5 * f64::from(i), 30.0 + 1.5 * f64::from(j)];
                if (board[0] - 30.0).hypot(board[1] - 30.0) < 6.0 {
                    continue;
                }
                let ray = [board[0] / 800.0, board[1] / 800.0];
                let outlier = if (i * 7 + j * 3) % 11 == 0 { 1.1 } else { 1.0 };
                let depth_mm = outlier / plane(ray[0], ray[1]);
                let context = Context::default();
                pixels.push(BoardPixel { context, depth_mm, board_depth_mm: depth_mm, board, ray, cos_incidence: 1.0 });
            }
        }
        let ray = [30.0 / 800.0, 30.0 / 800.0];
        let found = marker_inverse_depths(&target, &[(4, ray)], &pixels)[0].unwrap();
        assert!((found / plane(ray[0], ray[1]) - 1.0).abs() < 1e-9, "{found}");
    }
}
