//! Where a calibration is supported: the part of the image and the range of depth in which boards were seen.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::camera::Camera;
use crate::piece::Context;

/// Columns of the grid over the image.
const COLUMNS: usize = 32;
/// Depth of the rays of the grid, mm.
const TYPICAL_MM: f64 = 1000.0;
/// Share by which depth may lie beyond the boards.
const BEYOND: f64 = 0.05;

/// The part of the image in which boards were seen, and the range of their depth.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    size: [usize; 2],
    grid: [usize; 2],
    cells: Vec<bool>,
    /// Nearest and farthest depth of a board, mm.
    pub range_mm: [f64; 2],
}

impl Support {
    /// Where a camera saw boards, given by lowest and highest (x, y) of their markers, mm, and poses; `None` where it saw none.
    pub fn of_boards(
        camera: &Camera,
        [low, high]: [[f64; 2]; 2],
        camera_from_board: &[Isometry3<f64>],
    ) -> Option<Self> {
        let size = [camera.width, camera.height];
        let rows = ((COLUMNS * size[1]) as f64 / size[0].max(1) as f64).round().max(1.0) as usize;
        let mut cells = vec![false; COLUMNS * rows];
        let [mut near, mut far] = [f64::INFINITY, 0.0f64];
        // The board goes on beyond its outermost markers.
        let margin = 0.02 * (high[0] - low[0]).max(high[1] - low[1]);
        for (cell, seen) in cells.iter_mut().enumerate() {
            let [column, row] = [cell % COLUMNS, cell / COLUMNS];
            let place = |i: usize, n: usize, size: usize| (i as f64 + 0.5) * size as f64 / n as f64 - 0.5;
            let pixel = [place(column, COLUMNS, size[0]), place(row, rows, size[1])];
            let Ok([x, y]) = camera.ray(pixel, 1.0 / TYPICAL_MM) else { continue };
            let ray = Vector3::new(x, y, 1.0);
            for pose in camera_from_board {
                let normal = pose.rotation * Vector3::z();
                let depth = normal.dot(&pose.translation.vector) / normal.dot(&ray);
                let on_board = pose.inverse_transform_point(&Point3::from(ray * depth));
                let within = (0..2).all(|i| on_board[i] > low[i] - margin && on_board[i] < high[i] + margin);
                if depth > 0.0 && within {
                    *seen = true;
                    near = near.min(depth);
                    far = far.max(depth);
                }
            }
        }
        (far > 0.0).then_some(Self { size, grid: [COLUMNS, rows], cells, range_mm: [near, far] })
    }

    /// Whether boards were seen at a pixel of the image, at any depth.
    pub fn holds_pixel(&self, pixel: [f64; 2]) -> bool {
        let cell = |i: usize| (pixel[i] + 0.5) * self.grid[i] as f64 / self.size[i] as f64;
        let [column, row] = [cell(0), cell(1)];
        let within = |place: f64, i: usize| place >= 0.0 && place < self.grid[i] as f64;
        within(column, 0) && within(row, 1) && self.cells[row as usize * self.grid[0] + column as usize]
    }

    /// The range of the boards and a little beyond, mm.
    pub fn supported_mm(&self) -> [f64; 2] {
        [self.range_mm[0] * (1.0 - BEYOND), self.range_mm[1] * (1.0 + BEYOND)]
    }

    /// Whether every pixel of the depth image of `camera` lies where boards were seen, row by row.
    pub fn pixels(&self, camera: &Camera) -> Vec<bool> {
        let is_seen = |index: usize| {
            let pixel = [(index % camera.width) as f64, (index / camera.width) as f64];
            self.holds_pixel(camera.image_pixel(&Context { pixel, ..Context::default() }))
        };
        (0..camera.width * camera.height).map(is_seen).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A board of 200 × 100 mm, parallel to the image plane at 1 m, covers 100 × 50 px of a camera of 500 px focal length.
    #[test]
    fn a_board_supports_the_pixels_that_it_covers() {
        let camera = Camera::new(640, 480, [500.0, 500.0, 319.5, 239.5, 0.0], vec![]);
        let rectangle = [[0.0, 0.0], [200.0, 100.0]];
        let poses = [1000.0, 2000.0].map(|z| Isometry3::translation(0.0, 0.0, z));
        let support = Support::of_boards(&camera, rectangle, &poses).unwrap();
        assert!(support.holds_pixel([370.0, 260.0]) && support.holds_pixel([410.0, 280.0]));
        assert!(!support.holds_pixel([300.0, 260.0]) && !support.holds_pixel([450.0, 260.0]));
        assert!(!support.holds_pixel([-1.0, 260.0]) && !support.holds_pixel([370.0, 480.0]));
        assert_eq!(support.range_mm, [1000.0, 2000.0]);
        assert_eq!(support.supported_mm(), [950.0, 2100.0]);
        // Cells are 20 px: 5 or 6 by 3 of 32 by 24 hold the board's 100 × 50 px.
        let cells = support.cells.iter().filter(|seen| **seen).count();
        assert!((13..22).contains(&cells), "{cells}");
        assert_eq!(Support::of_boards(&camera, rectangle, &[Isometry3::translation(0.0, 0.0, -500.0)]), None);
    }
}
