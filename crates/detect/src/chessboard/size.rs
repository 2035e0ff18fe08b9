//! The size of a chessboard of which nothing is known.

use depthcal_io::GrayImage;

use super::saddles::lattices;
use crate::stretch::{Plane, Stretch};

/// Standard deviations of the smoothing with which crossings are looked for, px.
const SMOOTHING: [f32; 2] = [1.0, 2.0];
/// Fewest crossings of a board.
const LEAST_CROSSINGS: usize = 12;
/// Least share of a row's places, or a column's, that have a crossing, for it to belong to the board.
const FILLED: f64 = 0.7;

/// The numbers of inner corners of the largest chessboard in an image, along its two sides, in either order.
/// `None` where there is none.
pub fn chessboard_size(image: &GrayImage) -> Option<[usize; 2]> {
    let planes = Stretch::candidates(image).iter().map(|&stretch| Plane::stretched(image, stretch));
    planes
        .flat_map(|plane| {
            SMOOTHING.map(|sigma| lattices(&plane, sigma, LEAST_CROSSINGS).filter_map(size).collect::<Vec<_>>())
        })
        .flatten()
        .max_by_key(|size| size[0] * size[1])
}

/// Columns and rows of the nodes that are filled.
fn size(nodes: std::collections::BTreeMap<[i32; 2], [f64; 2]>) -> Option<[usize; 2]> {
    let mut bounds = [0, 1].map(|axis| {
        let values = || nodes.keys().map(|node| node[axis]);
        [values().min().unwrap_or(0), values().max().unwrap_or(0)]
    });
    // Crossings beyond a board's border fill no row: rows and columns are taken off while they are hardly filled.
    loop {
        let inside = |node: &[i32; 2]| (0..2).all(|axis| (bounds[axis][0]..=bounds[axis][1]).contains(&node[axis]));
        let side = |axis: usize| (bounds[axis][1] - bounds[axis][0] + 1).max(0) as usize;
        let filled = |axis: usize, end: usize| {
            let count = nodes.keys().filter(|node| inside(node) && node[axis] == bounds[axis][end]).count();
            count as f64 / side(1 - axis).max(1) as f64
        };
        if side(0) < 2 || side(1) < 2 {
            return None;
        }
        let ends = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(axis, end)| (filled(axis, end), axis, end));
        let (least, axis, end) = ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        if least >= FILLED {
            return Some([side(0), side(1)]);
        }
        bounds[axis][end] += if end == 0 { 1 } else { -1 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_of_a_board_are_counted() {
        let (columns, rows, square) = (8, 5, 24);
        let (width, height) = ((columns + 3) * square, (rows + 3) * square);
        let mut image = GrayImage { width, height, data: vec![230; width * height], bits: 8 };
        for (x, y) in (0..width * height).map(|i| (i % width, i / width)) {
            let [j, i] = [x / square, y / square];
            if (1..=columns + 1).contains(&j) && (1..=rows + 1).contains(&i) && (i + j) % 2 == 0 {
                image.data[y * width + x] = 20;
            }
        }
        let mut size = chessboard_size(&image).expect("a board");
        size.sort_unstable();
        assert_eq!(size, [rows, columns]);
        let blank = GrayImage { data: vec![230; width * height], ..image };
        assert_eq!(chessboard_size(&blank), None);
    }
}
