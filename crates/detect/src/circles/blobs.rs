//! Dots as elliptical regions of the component tree.

use super::tree::{Node, component_tree};

/// Grey levels (of 255) that a dot must differ from its surroundings.
const MIN_CONTRAST: u8 = 10;
/// Smallest and largest area of a dot, px² and fraction of the image.
const MIN_AREA: u32 = 6;
const MAX_AREA_FRACTION: f64 = 0.05;
/// Area over the area of the ellipse with the same second moments: 1 for an ellipse, 0.955 for a rectangle, less for
/// anything that is concave or has holes. Small dots are rough.
const SOLIDITY: [f64; 2] = [0.88, 1.12];
/// Longest over shortest axis; a circle seen at 70° has 2.9.
const MAX_ELONGATION: f64 = 4.0;

/// A dot candidate, px.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blob {
    pub(crate) center: [f64; 2],
    /// Covariance of the region's area: xx, xy, yy. A disc of radius r has r²/4.
    pub(crate) covariance: [f64; 3],
    pub(crate) area: f64,
    /// Grey levels between the dot and the level at which it merges with something else.
    pub(crate) contrast: u8,
}

impl Blob {
    /// Length of `d` in units of the dot's own radius in that direction: undoes the tilt of the board.
    pub(crate) fn in_radii(&self, d: [f64; 2]) -> f64 {
        self.dot_product(d, d).max(0.0).sqrt()
    }

    /// Scalar product in the metric in which this dot is the unit disc.
    pub(crate) fn dot_product(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let [xx, xy, yy] = self.covariance;
        let det = xx * yy - xy * xy;
        (yy * a[0] * b[0] - xy * (a[0] * b[1] + a[1] * b[0]) + xx * a[1] * b[1]) / (4.0 * det)
    }
}

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

/// All dark dots of an 8-bit image, by falling contrast, at most `limit`.
pub(crate) fn dark_blobs(data: &[u8], width: usize, height: usize, limit: usize) -> Vec<Blob> {
    let tree = component_tree(data, width, height);
    let max_area = MAX_AREA_FRACTION * data.len() as f64;
    let good: Vec<bool> = tree.iter().map(|n| is_elliptical(n, max_area)).collect();
    // The heaviest child of every node: the way down to the half level that does not lose the dot.
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
        // The top of an unbroken run of elliptical regions.
        if !good[i] || (parent != i && good[parent]) {
            continue;
        }
        // Up to the level at which it merges with something else.
        let top = if parent == i { node.level } else { tree[parent].level - 1 };
        let contrast = top - node.darkest;
        if contrast < MIN_CONTRAST {
            continue;
        }
        let half = node.darkest + contrast / 2;
        let mut at = i;
        while tree[at].level > half && heavy[at] != u32::MAX {
            at = heavy[at] as usize;
        }
        // Below the half level the region can be torn by noise: take the last good one.
        while !good[at] && at != i {
            at = tree[at].parent as usize;
        }
        let found = tree[at];
        blobs.push(Blob {
            center: found.center(),
            covariance: found.covariance(),
            area: f64::from(found.area),
            contrast,
        });
    }
    blobs.sort_by(|a, b| {
        b.contrast.cmp(&a.contrast).then(a.center[1].total_cmp(&b.center[1])).then(a.center[0].total_cmp(&b.center[0]))
    });
    without_duplicates(blobs, limit)
}

/// Keeps the strongest of several runs on the same dot.
fn without_duplicates(blobs: Vec<Blob>, limit: usize) -> Vec<Blob> {
    let mut kept: Vec<Blob> = Vec::new();
    for blob in blobs {
        let same = |k: &&Blob| {
            let d = [k.center[0] - blob.center[0], k.center[1] - blob.center[1]];
            k.in_radii(d) < 0.7 && blob.in_radii(d) < 0.7 && (0.4..2.5).contains(&(k.area / blob.area))
        };
        if !kept.iter().any(|k| same(&k)) {
            kept.push(blob);
        }
        if kept.len() == limit {
            break;
        }
    }
    kept
}
