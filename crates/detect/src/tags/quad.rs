//! The quadrilateral around a region.

use super::hull::{area, convex_hull, cross};

/// Least share of the quadrilateral's area that the region's hull covers. Blur rounds corners off.
const LEAST_COVER: f64 = 0.8;
/// Largest ratio of two sides: a square seen at 75°.
const MAX_RATIO: f64 = 5.0;

/// Corners of a quadrilateral (px), clockwise in the image.
pub(super) type Quad = [[f64; 2]; 4];

/// The quadrilateral around an outline, where it is about one; its sides are at least `least` px long.
pub(super) fn around(outline: Vec<[f64; 2]>, least: f64) -> Option<Quad> {
    let hull = convex_hull(outline);
    let covered = area(&hull);
    let quad = enclosing(hull)?;
    let sides = lengths(&quad);
    let (short, long) = sides.iter().fold((f64::INFINITY, 0.0f64), |(s, l), &side| (s.min(side), l.max(side)));
    (covered > LEAST_COVER * area(&quad) && short >= least && long < MAX_RATIO * short).then_some(quad)
}

/// Lengths of the sides, px.
pub(super) fn lengths(quad: &Quad) -> [f64; 4] {
    std::array::from_fn(|i| {
        let (a, b) = (quad[i], quad[(i + 1) % 4]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    })
}

/// Whether the corners run clockwise in the image and none is reflex.
pub(super) fn is_convex(quad: &Quad) -> bool {
    (0..4).all(|i| cross(quad[i], quad[(i + 1) % 4], quad[(i + 2) % 4]) > 0.0)
}

/// Takes sides off a convex polygon, each time the one without which the polygon grows least, until four are left. The sides
/// that stay are sides of the hull, which noise and rounded corners displace less than its corners.
fn enclosing(mut polygon: Vec<[f64; 2]>) -> Option<Quad> {
    while polygon.len() > 4 {
        let n = polygon.len();
        let (_, side, corner) = (0..n)
            .filter_map(|i| {
                let [a, b, c, d] = [n - 1, 0, 1, 2].map(|k| polygon[(i + k) % n]);
                let meeting = intersection([a, b], [d, c])?;
                let added = cross(b, meeting, c) / 2.0;
                // The neighbouring sides must meet beyond the side between them.
                (added >= 0.0).then_some((added, i, meeting))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        polygon[side] = corner;
        polygon.remove((side + 1) % n);
    }
    let quad: Quad = polygon.try_into().ok()?;
    is_convex(&quad).then_some(quad)
}

/// Where two lines meet, each given by two points; `None` for parallels.
pub(super) fn intersection([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> Option<[f64; 2]> {
    let (r, s) = ([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]);
    let determinant = r[0] * s[1] - r[1] * s[0];
    if determinant.abs() < 1e-9 * r[0].hypot(r[1]) * s[0].hypot(s[1]) {
        return None;
    }
    let t = ((c[0] - a[0]) * s[1] - (c[1] - a[1]) * s[0]) / determinant;
    Some([a[0] + t * r[0], a[1] + t * r[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_cut_corners_is_a_square() {
        let cut = [[1.0, 0.0], [9.0, 0.0], [10.0, 1.0], [10.0, 9.0], [9.0, 10.0], [1.0, 10.0], [0.0, 9.0], [0.0, 1.0]];
        let quad = around(cut.to_vec(), 5.0).expect("a quadrilateral");
        for corner in [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]] {
            assert!(quad.iter().any(|p| (p[0] - corner[0]).hypot(p[1] - corner[1]) < 1e-9), "{quad:?}");
        }
        assert!(is_convex(&quad));
    }

    #[test]
    fn a_disc_is_none() {
        let disc = (0..40).map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 40.0).sin_cos();
            [10.0 * cos, 10.0 * sin]
        });
        assert_eq!(around(disc.collect(), 5.0), None);
    }
}
