//! The sides of a quadrilateral, fitted to where the grey values change.

use super::quad::{Quad, intersection, is_convex, lengths};
use crate::stretch::Plane;

/// Places along a side at which its edge is looked for.
const PLACES: usize = 16;
/// Share of a side at either end that is left out: other sides are near.
const ENDS: f64 = 0.12;
/// Step along the normal, px.
const STEP_PX: f64 = 0.25;
/// Range of the search along the normal to either side, in cells, px at least and px at most.
const REACH: f64 = 0.7;
const REACH_PX: [f64; 2] = [1.5, 3.5];
/// Least difference between outside and inside, of the plane's range.
const LEAST_CONTRAST: f64 = 0.03;
/// An edge farther from the line through the others than this is left out, px.
const STRAY_PX: f64 = 0.7;

/// The quadrilateral with its sides moved to the edges between dark (inside) and bright (outside); `cells` is the number of a
/// tag's cells along a side. `None` where fewer than half of a side's places have an edge.
pub(super) fn fitted(plane: &Plane, quad: &Quad, cells: usize) -> Option<Quad> {
    let mut quad = *quad;
    // The second time from better normals.
    for _ in 0..2 {
        let sides = lengths(&quad);
        let lines = (0..4).map(|i| {
            let cell = sides[(i + 1) % 4].min(sides[(i + 3) % 4]) / cells as f64;
            side(plane, quad[i], quad[(i + 1) % 4], (REACH * cell).clamp(REACH_PX[0], REACH_PX[1]))
        });
        let lines: Vec<[[f64; 2]; 2]> = lines.collect::<Option<_>>()?;
        let corners: Option<Vec<_>> = (0..4).map(|i| intersection(lines[(i + 3) % 4], lines[i])).collect();
        quad = corners?.try_into().ok()?;
        if !is_convex(&quad) {
            return None;
        }
    }
    Some(quad)
}

/// Two points of the line through the edges of the side from `a` to `b`.
fn side(plane: &Plane, a: [f64; 2], b: [f64; 2], reach: f64) -> Option<[[f64; 2]; 2]> {
    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
    let along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    // Corners run clockwise with y down: the outside is to the left of the way.
    let outward = [along[1], -along[0]];
    let steps = (2.0 * reach / STEP_PX).round() as usize;
    let mut edges: Vec<[f64; 2]> = Vec::with_capacity(PLACES);
    let mut profile = vec![0.0; steps + 1];
    for place in 0..PLACES {
        let s = length * (ENDS + (1.0 - 2.0 * ENDS) * (place as f64 + 0.5) / PLACES as f64);
        let origin = [a[0] + s * along[0], a[1] + s * along[1]];
        let offset = |k: usize| k as f64 * STEP_PX - reach;
        let seen = profile.iter_mut().enumerate().try_for_each(|(k, value)| {
            *value = plane.between([origin[0] + offset(k) * outward[0], origin[1] + offset(k) * outward[1]])?;
            Some(())
        });
        if seen.is_none() {
            continue;
        }
        if let Some(offset) = crossing(&profile).map(|k| k * STEP_PX - reach) {
            edges.push([s, offset]);
        }
    }
    if 2 * edges.len() < PLACES {
        return None;
    }
    let (offset, slope) = robust_line(&mut edges)?;
    let point = |s: f64| {
        let t = offset + slope * s;
        [a[0] + s * along[0] + t * outward[0], a[1] + s * along[1] + t * outward[1]]
    };
    Some([point(0.0), point(length)])
}

/// Where a profile from dark to bright passes the middle between its ends, nearest to its own middle; in steps.
fn crossing(profile: &[f64]) -> Option<f64> {
    let n = profile.len();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (inside, outside) = (mean(&profile[..3]), mean(&profile[n - 3..]));
    if outside - inside < LEAST_CONTRAST {
        return None;
    }
    let level = (inside + outside) / 2.0;
    let middle = (n - 1) as f64 / 2.0;
    (0..n - 1)
        .filter(|&k| profile[k] < level && profile[k + 1] >= level)
        .map(|k| k as f64 + (level - profile[k]) / (profile[k + 1] - profile[k]))
        .min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()))
}

/// Offset and slope of the line through (s, offset), without the edges that are far from it.
fn robust_line(edges: &mut Vec<[f64; 2]>) -> Option<(f64, f64)> {
    loop {
        let n = edges.len() as f64;
        let (s, t) = edges.iter().fold((0.0, 0.0), |(s, t), e| (s + e[0] / n, t + e[1] / n));
        let (mut ss, mut st) = (0.0, 0.0);
        for e in edges.iter() {
            ss += (e[0] - s).powi(2);
            st += (e[0] - s) * (e[1] - t);
        }
        if !(ss > 0.0) {
            return None;
        }
        let slope = st / ss;
        let distance = |e: &[f64; 2]| (e[1] - t - slope * (e[0] - s)).abs();
        let worst = edges.iter().enumerate().max_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
        if distance(worst.1) < STRAY_PX || 2 * edges.len() <= PLACES {
            return Some((t - slope * s, slope));
        }
        let worst = worst.0;
        edges.remove(worst);
    }
}
