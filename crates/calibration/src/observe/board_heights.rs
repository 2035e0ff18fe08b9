//! Heights of the board's surface over its plane, on a grid: every board pixel of every frame asks for several.

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Target};

/// Cells along each side of the grid. A surface that bends by 2 mm over the board is interpolated within 2 µm.
const CELLS: usize = 192;

/// Heights of a board's surface over its plane, mm, by the camera's board pieces; interpolated between the nodes of a grid.
#[derive(Debug, Clone)]
pub struct BoardHeights {
    low: [f64; 2],
    cells_per_mm: [f64; 2],
    /// Row by row, CELLS + 1 in each.
    nodes: Vec<f64>,
}

impl BoardHeights {
    /// The heights of a board; `None` where the camera has no board pieces and the board is flat.
    pub fn new(camera: &Camera, target: &Target) -> Option<Self> {
        if !camera.blocks().iter().any(|b| b.hook() == HookKind::Board) {
            return None;
        }
        let [first, last] = target.marker_rectangle();
        // Dots and squares reach beyond the markers by less than a spacing or two.
        let margin = 2.0 * target.spacing_mm;
        let (low, high) = (first.map(|x| x - margin), last.map(|x| x + margin));
        let step = [0, 1].map(|axis| (high[axis] - low[axis]) / CELLS as f64);
        let height =
            |i: usize, j: usize| camera.board_point([low[0] + step[0] * i as f64, low[1] + step[1] * j as f64])[2];
        let nodes = (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| (i, j))).map(|(i, j)| height(i, j)).collect();
        Some(Self { low, cells_per_mm: step.map(f64::recip), nodes })
    }

    /// Height at a point of the board's plane, mm; beyond the grid that of its edge.
    pub fn at(&self, point: [f64; 2]) -> f64 {
        let cell = |axis: usize| {
            let t = ((point[axis] - self.low[axis]) * self.cells_per_mm[axis]).clamp(0.0, CELLS as f64);
            let first = (t as usize).min(CELLS - 1);
            (first, t - first as f64)
        };
        let ((i, s), (j, t)) = (cell(0), cell(1));
        let row = |j: usize| {
            let node = j * (CELLS + 1) + i;
            self.nodes[node] + s * (self.nodes[node + 1] - self.nodes[node])
        };
        row(j) + t * (row(j + 1) - row(j))
    }
}

#[cfg(test)]
mod tests {
    use depthcal_model::{Pattern, Register};

    use super::*;

    #[test]
    fn heights_are_those_of_the_board_pieces() {
        let target = Target { pattern: Pattern::Chessboard, columns: 9, rows: 6, spacing_mm: 25.0 };
        let register = Register::builtin().for_board(&target);
        let block = |name: &str, value: f64| {
            let mut block = register.block(name, None).unwrap();
            block.theta.fill(value);
            block
        };
        let flat = Camera::new(640, 480, [500.0, 500.0, 320.0, 240.0, 0.0], Vec::new());
        assert!(BoardHeights::new(&flat, &target).is_none());
        let camera = flat.with_block(block("board_bow", 2e-5)).with_block(block("board_warp", 0.2));
        let heights = BoardHeights::new(&camera, &target).unwrap();
        let mut largest = 0.0f64;
        for i in 0..=40 {
            for j in 0..=25 {
                let point = [5.03 * f64::from(i), 5.01 * f64::from(j)];
                let exact = camera.board_point(point)[2];
                largest = largest.max(exact.abs());
                assert!((heights.at(point) - exact).abs() < 2e-3, "{point:?}: {} and not {exact}", heights.at(point));
            }
        }
        assert!(largest > 1.0, "the board is bent by {largest} mm only");
    }
}
