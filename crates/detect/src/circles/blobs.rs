//! Dots as elliptical regions of the component tree.

use super::tree::{Node, component_tree};
use crate::lattice::blob::Blob;

/// Least contrast between a dot and its surroundings, grey levels of 255.
const MIN_CONTRAST: u8 = 10;
/// Smallest area of a dot, px².
const MIN_AREA: u32 = 6;
/// Largest area of a dot, as a fraction of the image.
const MAX_AREA_FRACTION: f64 = 0.05;
/// Range of a region's area over that of the ellipse with the same second moments: 1 for an ellipse, 0.955 for a
/// rectangle, less for concave shapes and for holes. It is wide because small dots are coarsely sampled.
const SOLIDITY: [f64; 2] = [0.88, 1.12];
/// Largest ratio of the axes; a circle seen at 70° has 2.9.
const MAX_ELONGATION: f64 = 4.0;

fn is_elliptical(node: &Node, max_area: f64) -> bool {
    if node.area < MIN_AREA || f64::from(node.area) > max_area {
        return false;
    }
    let [xx, xy, yy] = node.covariance();
    let det = xx * yy - xy * xy;
    if det <= 0.0 {
        return false;
    }
    let solidity = f64::from(node.area) / (4.0 * std::f64::consts::PI * det.sqrt());
    let (mean, difference) = ((xx + yy) / 2.0, (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt());
    let elongation = ((mean + difference) / (mean - difference).max(1e-9)).sqrt();
    (SOLIDITY[0]..=SOLIDITY[1]).contains(&solidity) && elongation <= MAX_ELONGATION
}

/// The dark dots of an 8-bit image (row-major), at most `limit`, in descending order of contrast.
pub(crate) fn dark_blobs(data: &[u8], width: usize, height: usize, limit: usize) -> Vec<Blob> {
    let tree = component_tree(data, width, height);
    let max_area = MAX_AREA_FRACTION * data.len() as f64;
    let good: Vec<bool> = tree.iter().map(|n| is_elliptical(n, max_area)).collect();
    // The largest child of every node: descending along it to the half level stays on the dot.
    let mut heavy = vec![u32::MAX; tree.len()];
    for (i, node) in tree.iter().enumerate() {
        let up = node.parent as usize;
        if up != i && (heavy[up] == u32::MAX || tree[heavy[up] as usize].area < node.area) {
            heavy[up] = i as u32;
        }
    }
    let mut blobs: Vec<Blob> = Vec::new();
    for (i, node) in tree.iter().enumerate() {
        let parent = node.parent as usize;
        // Only the top of an unbroken run of elliptical regions is a candidate.
        if !good[i] || (parent != i && good[parent]) {
            continue;
        }
        // The highest level before it merges with something else.
        let top = if parent == i { node.level } else { tree[parent].level - 1 };
        let contrast = top - node.darkest;
        if contrast < MIN_CONTRAST {
            continue;
        }
        let half = node.darkest + contrast / 2;
        let mut node = i;
        while tree[node].level > half && heavy[node] != u32::MAX {
            node = heavy[node] as usize;
        }
        // At low levels noise can tear the region apart: go back to the last elliptical one.
        while !good[node] && node != i {
            node = tree[node].parent as usize;
        }
        let blob = tree[node];
        blobs.push(Blob { center: blob.center(), covariance: blob.covariance(), area: f64::from(blob.area), contrast });
    }
    blobs.sort_by(|a, b| {
        b.contrast.cmp(&a.contrast).then(a.center[1].total_cmp(&b.center[1])).then(a.center[0].total_cmp(&b.center[0]))
    });
    without_duplicates(blobs, limit)
}

/// Of several candidates on the same dot, keeps the one of highest contrast.
fn without_duplicates(blobs: Vec<Blob>, limit: usize) -> Vec<Blob> {
    let mut distinct: Vec<Blob> = Vec::new();
    for blob in blobs {
        let same = |k: &&Blob| {
            let d = [k.center[0] - blob.center[0], k.center[1] - blob.center[1]];
            k.in_radii(d) < 0.7 && blob.in_radii(d) < 0.7 && (0.4..2.5).contains(&(k.area / blob.area))
        };
        if !distinct.iter().any(|k| same(&k)) {
            distinct.push(blob);
        }
        if distinct.len() == limit {
            break;
        }
    }
    distinct
}
