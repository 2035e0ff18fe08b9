//! The board's plane in the camera frame, and the board's depth on rays.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::board_heights::BoardHeights;

/// Most rounds in which a ray is brought to a board's surface.
const MOST_ROUNDS: usize = 5;
/// Distance from the surface at which a ray has reached it, mm: far below what any sensor resolves.
const SETTLED_MM: f64 = 1e-4;
/// Distance from the surface that a ray may have after the last round, mm.
const NEAR_MM: f64 = 1e-3;

/// The board's plane in the camera frame.
#[derive(Debug, Clone, Copy)]
pub struct BoardPlane {
    /// Rotation and translation that map the camera's frame to the board's.
    board_from_camera: (Matrix3<f64>, Vector3<f64>),
    normal: Vector3<f64>,
    offset: f64,
}

impl BoardPlane {
    /// The plane z = 0 of the board's frame.
    pub fn new(camera_from_board: &Isometry3<f64>) -> Self {
        let normal = camera_from_board.rotation * Vector3::z();
        let offset = normal.dot(&camera_from_board.translation.vector);
        let inverse = camera_from_board.inverse();
        let board_from_camera = (inverse.rotation.to_rotation_matrix().into_inner(), inverse.translation.vector);
        Self { board_from_camera, normal, offset }
    }

    /// Depth (mm) at which a ray (X/Z, Y/Z) meets the plane; `None` where it meets none in front of the camera.
    pub fn depth(&self, ray: [f64; 2]) -> Option<f64> {
        let z = self.offset / self.normal.dot(&Vector3::new(ray[0], ray[1], 1.0));
        (z > 0.0 && z.is_finite()).then_some(z)
    }

    /// The state that depth pieces are given on a ray: x, y, inverse depth of the plane (1/mm), cosine of the angle of incidence;
    /// `None` where the ray does not meet the plane.
    pub fn depth_state(&self, ray: [f64; 2]) -> Option<[f64; 4]> {
        Some([ray[0], ray[1], 1.0 / self.depth(ray)?, self.cos_incidence(ray)])
    }

    /// A point on a ray at a depth (mm), in board coordinates, mm.
    pub fn to_board(&self, ray: [f64; 2], depth_mm: f64) -> Point3<f64> {
        let (rotation, translation) = &self.board_from_camera;
        Point3::from(rotation * (Vector3::new(ray[0], ray[1], 1.0) * depth_mm) + translation)
    }

    /// Cosine of the angle between a ray and the normal, in [0, 1].
    pub fn cos_incidence(&self, ray: [f64; 2]) -> f64 {
        let d = Vector3::new(ray[0], ray[1], 1.0);
        self.normal.dot(&d).abs() / d.norm()
    }
}

/// The board's surface in the camera frame: its plane, or what the camera's board pieces make of it.
#[derive(Debug, Clone, Copy)]
pub struct BoardSurface<'a> {
    plane: BoardPlane,
    /// Heights over the plane, where the camera has board pieces.
    heights: Option<&'a BoardHeights>,
}

impl<'a> BoardSurface<'a> {
    /// The surface of a board in a pose.
    pub fn new(camera_from_board: &Isometry3<f64>, heights: Option<&'a BoardHeights>) -> Self {
        Self { plane: BoardPlane::new(camera_from_board), heights }
    }

    /// The plane of the nominal board.
    pub fn plane(&self) -> &BoardPlane {
        &self.plane
    }

    /// Depth (mm) at which a ray (X/Z, Y/Z) meets the surface; `None` where it meets none in front of the camera.
    pub fn depth(&self, ray: [f64; 2]) -> Option<f64> {
        let mut depth = self.plane.depth(ray)?;
        let Some(heights) = self.heights else { return Some(depth) };
        let (rotation, origin) = &self.plane.board_from_camera;
        let direction = rotation * Vector3::new(ray[0], ray[1], 1.0);
        // Fixed-point iteration. Heights are millimetres on boards of hundreds: each round gains two digits or more, but for rays
        // that graze the board or pass it far away, which meet no surface.
        let mut gap = f64::INFINITY;
        for _ in 0..MOST_ROUNDS {
            let point = origin + direction * depth;
            let height = heights.at([point.x, point.y]);
            gap = (height - point.z).abs();
            if gap < SETTLED_MM {
                break;
            }
            depth = (height - origin.z) / direction.z;
        }
        (depth > 0.0 && depth.is_finite() && gap < NEAR_MM).then_some(depth)
    }

    /// Height over the surface of a point on a ray at a depth (mm), mm.
    pub fn height(&self, ray: [f64; 2], depth_mm: f64) -> f64 {
        let point = self.plane.to_board(ray, depth_mm);
        point.z - self.heights.map_or(0.0, |heights| heights.at([point.x, point.y]))
    }
}
