//! The intersection of rays with the board.

use nalgebra::{Matrix3, Vector3};

use crate::board::Board;
use crate::instrument::BoardShape;
use crate::pose::Pose;

/// The board in one pose.
#[derive(Debug, Clone)]
pub(crate) struct PlacedBoard<'a> {
    pub board: &'a Board,
    pub shape: &'a BoardShape,
    pub pose: Pose,
    to_board: Matrix3<f64>,
    /// The camera's centre in the board frame.
    eye: Vector3<f64>,
}

/// Intersection of a ray with the board.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    /// Depth, mm.
    pub z: f64,
    /// Position in the board's design, mm.
    pub design: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cosine: f64,
}

impl<'a> PlacedBoard<'a> {
    pub fn new(board: &'a Board, shape: &'a BoardShape, pose: Pose) -> Self {
        let to_board = pose.matrix().transpose();
        let eye = -(to_board * Vector3::from(pose.translation));
        Self { board, shape, pose, to_board, eye }
    }

    /// Position in the camera frame (mm) of the point (x, y) of the board's design (mm).
    pub fn point(&self, design: [f64; 2]) -> [f64; 3] {
        self.pose.apply(self.shape.real(design))
    }

    /// Intersection of the ray (x, y, 1) with the card; `None` when it misses the card.
    pub fn cut(&self, ray: [f64; 2]) -> Option<Cut> {
        let direction = self.to_board * Vector3::new(ray[0], ray[1], 1.0);
        let mut z = -self.eye.z / direction.z;
        let mut gradient = [0.0, 0.0];
        if !self.shape.is_flat() {
            // The bow is small and quadratic: Newton's method from the flat board converges in three steps.
            for _ in 0..3 {
                let p = self.eye + direction * z;
                let (height, slope) = self.shape.height([p.x, p.y]);
                z -= (p.z - height) / (direction.z - slope[0] * direction.x - slope[1] * direction.y);
                gradient = slope;
            }
        }
        if !(z.is_finite() && z > 0.0) {
            return None;
        }
        let p = self.eye + direction * z;
        let design = self.shape.designed([p.x, p.y]);
        if !self.board.on_card(design) {
            return None;
        }
        let normal = Vector3::new(-gradient[0], -gradient[1], 1.0);
        let cosine = (normal.dot(&direction) / (normal.norm() * direction.norm())).abs();
        Some(Cut { z, design, cosine })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn rays_meet_the_bowed_board_where_its_points_are() {
        let board = Board::default();
        let mut shape = BoardShape::flat(&board);
        shape.bow = [1.0, -2.0, 0.7];
        shape.stretch_y = 0.004;
        let pose = Pose::new(Rotation3::new(Vector3::new(0.4, -0.3, 0.2)), Vector3::new(-40.0, -70.0, 600.0));
        let placed = PlacedBoard::new(&board, &shape, pose);
        for index in 0..board.len() {
            let design = board.marker(index);
            let [x, y, z] = placed.point(design);
            let cut = placed.cut([x / z, y / z]).unwrap();
            assert!((cut.z - z).abs() < 1e-9);
            assert!((cut.design[0] - design[0]).hypot(cut.design[1] - design[1]) < 1e-9);
        }
    }

    #[test]
    fn incidence_on_a_frontal_board_is_that_of_the_ray() {
        let board = Board::default();
        let shape = BoardShape::flat(&board);
        let placed = PlacedBoard::new(&board, &shape, Pose::new(Rotation3::identity(), Vector3::new(0.0, 0.0, 500.0)));
        let cut = placed.cut([0.1, 0.2]).unwrap();
        assert!((cut.cosine - 1.0 / 1.05f64.sqrt()).abs() < 1e-12);
        assert!((cut.z - 500.0).abs() < 1e-12);
        assert!(placed.cut([-0.3, 0.0]).is_none());
    }
}
