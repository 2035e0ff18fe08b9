//! The board in a lattice: which node is which marker.

use depthcal_model::target::{Pattern, Target};

use super::neighbourhood::Lattice;

/// A placement of the board is accepted only when every other placement lacks at least this many markers more.
const MARGIN: usize = 3;
/// Largest share of markers that may be missing, for instance hidden by a reflection or a finger.
const MAX_MISSING: f64 = 0.1;

/// Lattice coordinates of a board's markers in the board's order, in a right-handed basis of nearest neighbours.
pub(crate) fn board_cells(target: &Target) -> Vec<[i32; 2]> {
    (0..target.len())
        .map(|index| {
            let (j, i) = ((index % target.columns) as i32, (index / target.columns) as i32);
            match target.pattern {
                Pattern::AsymmetricCircles { .. } => {
                    let (x, y) = (2 * j + i % 2, i);
                    [(x + y) / 2, (y - x).div_euclid(2)]
                }
                _ => [j, i],
            }
        })
        .collect()
}

/// A cell after `turns` quarter turns about the origin.
fn turned(mut cell: [i32; 2], turns: usize) -> [i32; 2] {
    for _ in 0..turns {
        cell = [-cell[1], cell[0]];
    }
    cell
}

/// A placement of the board in the lattice, with its markers assigned to cells.
struct Labelling {
    /// Number of cells without a candidate.
    missing: usize,
    /// The cells, sorted: equal for all labellings of one placement.
    set: Vec<[i32; 2]>,
    /// The cells in the order of the markers.
    places: Vec<[i32; 2]>,
}

/// Lattice cell of every marker, for every labelling of the placement that lacks fewest markers. There are several when
/// the board looks the same after a turn, and none when the board is not in the lattice or its placement is ambiguous.
pub(crate) fn labellings(lattice: &Lattice, board: &[[i32; 2]]) -> Vec<Vec<[i32; 2]>> {
    let allowed = (MAX_MISSING * board.len() as f64) as usize;
    if lattice.len() + allowed < board.len() {
        return Vec::new();
    }
    let bounds = |cells: &mut dyn Iterator<Item = [i32; 2]>| {
        cells.fold(([i32::MAX; 2], [i32::MIN; 2]), |(low, high), c| {
            ([low[0].min(c[0]), low[1].min(c[1])], [high[0].max(c[0]), high[1].max(c[1])])
        })
    };
    let (low, high) = bounds(&mut lattice.keys().copied());
    let mut complete: Vec<Labelling> = Vec::new();
    for turns in 0..4 {
        let cells: Vec<[i32; 2]> = board.iter().map(|&c| turned(c, turns)).collect();
        let (cell_low, cell_high) = bounds(&mut cells.iter().copied());
        // Since markers may be missing, the board may extend beyond the lattice.
        let slack = if allowed > 0 { 1 } else { 0 };
        for dy in low[1] - cell_low[1] - slack..=high[1] - cell_high[1] + slack {
            for dx in low[0] - cell_low[0] - slack..=high[0] - cell_high[0] + slack {
                let places: Vec<[i32; 2]> = cells.iter().map(|c| [c[0] + dx, c[1] + dy]).collect();
                let limit = allowed + MARGIN;
                let mut missing = 0;
                for place in &places {
                    missing += usize::from(!lattice.contains_key(place));
                    if missing > limit {
                        break;
                    }
                }
                if missing <= limit {
                    let mut set = places.clone();
                    set.sort_unstable();
                    complete.push(Labelling { missing, set, places });
                }
            }
        }
    }
    complete.sort_by(|a, b| a.missing.cmp(&b.missing).then_with(|| a.set.cmp(&b.set)));
    let Some((best, set)) = complete.first().map(|f| (f.missing, f.set.clone())) else { return Vec::new() };
    let rival = complete.iter().find(|f| f.set != set).map(|f| f.missing);
    if best > allowed || rival.is_some_and(|r| r < best + MARGIN) {
        return Vec::new();
    }
    complete.into_iter().filter(|f| f.set == set).map(|f| f.places).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(asymmetric: bool, columns: usize, rows: usize) -> Target {
        let circle_diameter_mm = 10.0;
        let pattern = if asymmetric {
            Pattern::AsymmetricCircles { circle_diameter_mm }
        } else {
            Pattern::SymmetricCircles { circle_diameter_mm }
        };
        Target { pattern, columns, rows, spacing_mm: 17.0 }
    }

    fn lattice(cells: &[[i32; 2]], turns: usize, shift: [i32; 2]) -> Lattice {
        cells
            .iter()
            .enumerate()
            .map(|(i, &c)| {
                let c = turned(c, turns);
                ([c[0] + shift[0], c[1] + shift[1]], i)
            })
            .collect()
    }

    #[test]
    fn neighbouring_cells_are_neighbouring_dots() {
        let target = target(true, 4, 11);
        let cells = board_cells(&target);
        for a in 0..44 {
            for b in 0..44 {
                let (p, q) = (target.point(a), target.point(b));
                let squared = ((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)) / (2.0 * 17.0 * 17.0);
                let (c, d) = (cells[a], cells[b]);
                let steps = (c[0] - d[0]).pow(2) + (c[1] - d[1]).pow(2);
                assert!((squared - f64::from(steps)).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn an_asymmetric_board_is_labelled_in_any_turn() {
        let board = board_cells(&target(true, 4, 11));
        for turns in 0..4 {
            let lattice = lattice(&board, turns, [5, -3]);
            let all = labellings(&lattice, &board);
            assert_eq!(all.len(), 1);
            assert!(all[0].iter().enumerate().all(|(i, cell)| lattice[cell] == i));
        }
    }

    #[test]
    fn a_symmetric_board_has_two_labellings_and_a_square_one_four() {
        for (columns, rows, count) in [(6, 4, 2), (5, 5, 4)] {
            let board = board_cells(&target(false, columns, rows));
            assert_eq!(labellings(&lattice(&board, 1, [0, 2]), &board).len(), count);
        }
    }

    #[test]
    fn one_hidden_dot_is_forgiven_but_a_hidden_row_is_not() {
        let board = board_cells(&target(true, 4, 11));
        let mut seen = lattice(&board, 0, [0, 0]);
        seen.remove(&board[17]);
        assert_eq!(labellings(&seen, &board).len(), 1);
        let mut seen = lattice(&board, 0, [0, 0]);
        for cell in &board[..4] {
            seen.remove(cell);
        }
        let all = labellings(&seen, &board);
        assert!(all.iter().all(|f| f.iter().enumerate().all(|(i, c)| seen.get(c).is_none_or(|&k| k == i))));
        // A larger board than declared: the declared one fits in more than one place.
        let small = board_cells(&target(true, 4, 9));
        assert!(labellings(&lattice(&board, 0, [0, 0]), &small).is_empty());
    }
}
