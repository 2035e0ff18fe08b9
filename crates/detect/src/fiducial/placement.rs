//! Which corners of a ChArUco board a lattice of crossings is, from the tags between them.
//!
//! Reading a tag on its own takes every one of its bits. When the crossings around it are known, its cells need only be
//! looked up, and all tags together decide: the cells of all squares are compared with those of the printed tags for
//! every position and turn of the lattice on the board. This identifies boards whose tags are blurred beyond reading.

use std::collections::BTreeMap;

use depthcal_model::target::{CharucoLayout, Pattern, Target};

use crate::geometry::Homography;
use crate::stretch::Plane;

/// Least correlation between the cells seen and the cells printed.
const MIN_CORRELATION: f64 = 0.4;
/// Least distance between the best placement and the next, in standard deviations of a correlation's Fisher transform.
const MIN_LEAD: f64 = 5.0;
/// Least share of crossings that lie on the board, in a placement.
const MIN_ON_BOARD: f64 = 0.85;
/// Largest share of the squares with tags that show no tag: none is brighter around than in its border.
const MAX_BLANK: f64 = 0.2;

/// A lattice of crossings: pixel at every node, in a basis that is right-handed in the image.
pub(super) type Crossings = BTreeMap<[i32; 2], [f64; 2]>;

/// The tag in the square at column and row: its cells, whether they are white, with the border of one cell.
pub(super) type PrintedTags = BTreeMap<[usize; 2], Vec<Vec<bool>>>;

/// The printed tags of a board.
pub(super) struct Print<'a> {
    pub(super) target: &'a Target,
    /// The tags of every layout that the board may have.
    pub(super) layouts: Vec<(CharucoLayout, PrintedTags)>,
}

/// Where a lattice lies on the board.
pub(super) struct Placed {
    /// Index on the board of every crossing.
    pub(super) indices: BTreeMap<[i32; 2], usize>,
    /// The layout of the tags.
    pub(super) layout: CharucoLayout,
}

/// The cells of one square of the lattice as the image shows them.
struct Square {
    /// Lattice node with the smallest coordinates.
    low: [i32; 2],
    /// Grey values of the cells, by row and column in the lattice's directions, 0 for the tag's border and 1 for the
    /// paper around it, clamped to [−0.5, 1.5]; `None` where the border is not darker than the paper.
    cells: Option<Vec<Vec<f64>>>,
}

/// The placement that explains the tags much better than all others do.
pub(super) fn place(crossings: &Crossings, print: &Print, plane: &Plane) -> Option<Placed> {
    let Pattern::Charuco { marker_mm, .. } = print.target.pattern else { return None };
    let cells = print.layouts.first()?.1.values().next()?.len();
    let share = marker_mm / print.target.spacing_mm;
    let squares: Vec<Square> = crossings.keys().filter_map(|&low| look(low, crossings, plane, cells, share)).collect();
    let mut rated: Vec<(f64, f64, Placed)> = Vec::new();
    for (layout, tags) in &print.layouts {
        for turns in 0..4 {
            for placed in placements(crossings, print.target, turns) {
                if let Some((correlation, count)) = rate(&squares, &placed, tags, print.target, turns) {
                    rated.push((correlation, count, Placed { indices: placed, layout: *layout }));
                }
            }
        }
    }
    rated.sort_by(|a, b| b.0.total_cmp(&a.0));
    if rated.is_empty() {
        return None;
    }
    let (best, count, placed) = rated.remove(0);
    let fisher = |r: f64| r.clamp(-0.95, 0.95).atanh();
    // The same places in another layout are no rival.
    let rival = rated.iter().find(|r| r.2.indices != placed.indices).map_or(0.0, |r| r.0.max(0.0));
    let lead = (fisher(best) - fisher(rival)) * count.sqrt();
    (best > MIN_CORRELATION && lead > MIN_LEAD).then_some(placed)
}

/// All ways to put a lattice, turned by `turns` quarter turns, on the board. Nodes beside the board are left out.
fn placements(crossings: &Crossings, target: &Target, turns: usize) -> Vec<BTreeMap<[i32; 2], usize>> {
    let size = [target.columns as i32 - 1, target.rows as i32 - 1];
    let nodes: Vec<([i32; 2], [i32; 2])> = crossings.keys().map(|&node| (node, turned(node, turns))).collect();
    let range = |axis: usize| {
        let values = || nodes.iter().map(|n| n.1[axis]);
        // From the last node at the board's end to the first node at its beginning.
        Some(-values().max()?..size[axis] - values().min()?)
    };
    // An image without crossings has no place on the board.
    let (Some(columns), Some(rows)) = (range(0), range(1)) else { return Vec::new() };
    let mut all = Vec::new();
    for dy in rows {
        for dx in columns.clone() {
            let placed: BTreeMap<[i32; 2], usize> = nodes
                .iter()
                .map(|(node, [x, y])| (*node, [x + dx, y + dy]))
                .filter(|(_, [x, y])| (0..size[0]).contains(x) && (0..size[1]).contains(y))
                .map(|(node, [x, y])| (node, (y * size[0] + x) as usize))
                .collect();
            if placed.len() as f64 >= MIN_ON_BOARD * nodes.len() as f64 {
                all.push(placed);
            }
        }
    }
    all
}

/// Correlation of the cells seen with the cells printed, and the number of cells; `None` when the squares show no tags.
fn rate(
    squares: &[Square],
    placed: &BTreeMap<[i32; 2], usize>,
    layout: &PrintedTags,
    target: &Target,
    turns: usize,
) -> Option<(f64, f64)> {
    let columns = target.columns - 1;
    let (mut seen, mut blank) = (0usize, 0usize);
    // Count, sums of measured, printed, and of their products and squares.
    let mut sums = [0.0; 6];
    for square in squares {
        let [x, y] = square.low;
        let corners = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|node| placed.get(&node));
        let Some(corners) = corners.into_iter().collect::<Option<Vec<_>>>() else { continue };
        // The square's top left crossing on the board is the one of the smallest index.
        let first = *corners.into_iter().min()?;
        let Some(printed) = layout.get(&[first % columns + 1, first / columns + 1]) else { continue };
        seen += 1;
        let Some(cells) = &square.cells else {
            blank += 1;
            continue;
        };
        let n = printed.len();
        for (row, line) in printed.iter().enumerate().take(n - 1).skip(1) {
            for (column, &white) in line.iter().enumerate().take(n - 1).skip(1) {
                let [u, v] = unturned([2 * column as i32 + 1 - n as i32, 2 * row as i32 + 1 - n as i32], turns);
                let grey = cells[((v + n as i32 - 1) / 2) as usize][((u + n as i32 - 1) / 2) as usize];
                let white = f64::from(u8::from(white));
                for (sum, term) in sums.iter_mut().zip([1.0, grey, white, grey * grey, grey * white, white * white]) {
                    *sum += term;
                }
            }
        }
    }
    if seen == 0 || blank as f64 > MAX_BLANK * seen as f64 {
        return None;
    }
    let [n, x, y, xx, xy, yy] = sums;
    let (covariance, variances) = (xy - x * y / n, (xx - x * x / n) * (yy - y * y / n));
    (variances > 0.0).then(|| (covariance / variances.sqrt(), n))
}

/// Looks at the cells of the square whose node with the smallest coordinates is `low`; `None` when not all four of its
/// crossings are known. `share` is the side of a tag over that of a square.
fn look(low: [i32; 2], crossings: &Crossings, plane: &Plane, cells: usize, share: f64) -> Option<Square> {
    let pairs: Vec<([f64; 2], [f64; 2])> = [[0, 0], [1, 0], [1, 1], [0, 1]]
        .into_iter()
        .map(|[x, y]| Some(([f64::from(x), f64::from(y)], *crossings.get(&[low[0] + x, low[1] + y])?)))
        .collect::<Option<_>>()?;
    let map = Homography::fit(&pairs)?;
    let grey = |p: [f64; 2]| plane.between(map.apply(p)?);
    let margin = (1.0 - share) / 2.0;
    let coordinate = |k: usize| margin + share * (k as f64 + 0.5) / cells as f64;
    let mut values = vec![vec![0.0; cells]; cells];
    let (mut border, mut count) = (0.0, 0.0);
    for (row, line) in values.iter_mut().enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            *value = grey([coordinate(column), coordinate(row)])?;
            if [row, column].iter().any(|&k| k == 0 || k + 1 == cells) {
                border += *value;
                count += 1.0;
            }
        }
    }
    let around: Vec<f64> = (0..4 * cells)
        .map(|k| {
            let (s, outer) = (coordinate(k % cells), margin / 2.0);
            grey([[s, outer], [1.0 - outer, s], [s, 1.0 - outer], [outer, s]][k / cells])
        })
        .collect::<Option<_>>()?;
    let paper = around.iter().sum::<f64>() / around.len() as f64;
    let border = border / count;
    let scaled = |v: f64| ((v - border) / (paper - border)).clamp(-0.5, 1.5);
    let visible = paper - border > 0.03;
    Some(Square {
        low,
        cells: visible.then(|| values.into_iter().map(|l| l.into_iter().map(scaled).collect()).collect()),
    })
}

/// A node after `turns` quarter turns about the origin.
fn turned(mut node: [i32; 2], turns: usize) -> [i32; 2] {
    for _ in 0..turns {
        node = [-node[1], node[0]];
    }
    node
}

/// The inverse of [`turned`].
fn unturned(node: [i32; 2], turns: usize) -> [i32; 2] {
    turned(node, (4 - turns % 4) % 4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_part_of_a_board_has_one_place_for_every_position() {
        let pattern = Pattern::Charuco { marker_mm: 10.0, dictionary: "DICT_5X5_100".into() };
        let target = Target { pattern, columns: 6, rows: 4, spacing_mm: 20.0 };
        let whole: Crossings = (0..15).map(|i| ([i % 5, i / 5], [0.0, 0.0])).collect();
        assert_eq!(placements(&whole, &target, 0).len(), 1);
        assert_eq!(placements(&whole, &target, 2).len(), 1);
        assert!(placements(&Crossings::new(), &target, 0).is_empty());
        // Turned by a quarter it does not fit.
        assert_eq!(placements(&whole, &target, 1).len(), 0);
        let part: Crossings = (0..4).map(|i| ([i % 2 + 7, i / 2 - 3], [0.0, 0.0])).collect();
        for turns in 0..4 {
            let all = placements(&part, &target, turns);
            assert_eq!(all.len(), 4 * 2);
            assert!(all.iter().all(|placed| placed.len() == 4));
        }
        assert_eq!(unturned(turned([3, -5], 3), 3), [3, -5]);
    }
}
