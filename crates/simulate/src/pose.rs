//! Poses of the board, and their choice for a dataset kind.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{Rng, RngExt, seq::SliceRandom};
use serde::{Deserialize, Serialize};

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::error::SimulateError;
use crate::kind::{Kind, Placement};
use crate::optics::Optics;
use crate::streams::{Purpose, seed_with_name, stream};

/// Pose of the board: X = R P + t maps the board frame to the camera frame, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// R, row by row.
    pub rotation: [[f64; 3]; 3],
    /// t, mm.
    pub translation: [f64; 3],
}

impl Pose {
    pub(crate) fn new(rotation: Rotation3<f64>, translation: Vector3<f64>) -> Self {
        let m = rotation.matrix();
        Self {
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)])),
            translation: [translation.x, translation.y, translation.z],
        }
    }

    /// The pose with this rotation vector (radians) and translation (mm).
    pub fn from_rotation_vector(rotation: [f64; 3], translation: [f64; 3]) -> Self {
        Self::new(Rotation3::new(Vector3::from(rotation)), Vector3::from(translation))
    }

    /// The pose that leaves every point where it is.
    pub fn identity() -> Self {
        Self::from_rotation_vector([0.0; 3], [0.0; 3])
    }

    /// R as a matrix.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.rotation[i][j])
    }

    /// The point P (board frame, mm) in the camera frame, mm.
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        let x = self.matrix() * Vector3::from(p) + Vector3::from(self.translation);
        [x.x, x.y, x.z]
    }

    /// The composition that applies `first`, then this pose.
    pub fn after(&self, first: &Pose) -> Self {
        let rotation = Rotation3::from_matrix_unchecked(self.matrix() * first.matrix());
        Self::new(rotation, self.matrix() * Vector3::from(first.translation) + Vector3::from(self.translation))
    }

    /// Angle between the board and the image plane, radians.
    pub fn tilt(&self) -> f64 {
        self.rotation[2][2].clamp(-1.0, 1.0).acos()
    }

    /// This pose displaced by `shift` (camera frame, mm) and rotated by the rotation vector `turn` (radians) about
    /// `pivot` (board frame, mm).
    pub(crate) fn nudged(&self, pivot: [f64; 3], shift: [f64; 3], turn: [f64; 3]) -> Self {
        let middle = Vector3::from(self.apply(pivot));
        let rotation = Rotation3::new(Vector3::from(turn)) * Rotation3::from_matrix_unchecked(self.matrix());
        Self::new(rotation, middle + Vector3::from(shift) - rotation * Vector3::from(pivot))
    }
}

/// The poses of all frames of a dataset kind. They depend on the seed, not on the camera's effects.
pub(crate) fn choose(
    camera: &CameraTruth,
    board: &Board,
    kind: Kind,
    frames: usize,
    seed: u64,
) -> Result<Vec<Pose>, SimulateError> {
    let seed = seed_with_name(seed, &kind.to_string());
    let mut order: Vec<usize> = (0..frames).collect();
    order.shuffle(&mut stream(seed, Purpose::Pose, usize::MAX >> 32));
    let chooser = Chooser { optics: Optics::new(camera), camera, board, placement: kind.placement() };
    let choose_one = |(frame, slot): (usize, usize)| {
        let mut rng = stream(seed, Purpose::Pose, frame);
        // Distances are stratified, so that every capture covers the whole range.
        let share = (slot as f64 + rng.random::<f64>()) / frames as f64;
        chooser.pose(frame, share, &mut rng)
    };
    order.into_iter().enumerate().map(choose_one).collect()
}

struct Chooser<'a> {
    optics: Optics,
    camera: &'a CameraTruth,
    board: &'a Board,
    placement: Placement,
}

impl Chooser<'_> {
    fn pose(&self, frame: usize, share: f64, rng: &mut impl Rng) -> Result<Pose, SimulateError> {
        let Placement { near_mm, far_mm, .. } = self.placement;
        let mut distance = near_mm * (far_mm / near_mm).powf(share);
        // A large board does not fit into the image nearby; then it is placed farther away.
        while distance <= 1.5 * far_mm {
            for attempt in 0..120 {
                let ease = 1.0 - f64::from(attempt) / 120.0;
                let Some((rotation, ray)) = self.attitude(ease, rng) else { continue };
                let pose = self.at(rotation, ray, distance);
                if self.fits(&pose) {
                    return Ok(if rng.random_bool(0.3) {
                        self.towards_border(rotation, ray, distance, rng)
                    } else {
                        pose
                    });
                }
            }
            distance *= 1.05;
        }
        let (width, height) = (self.camera.width, self.camera.height);
        Err(SimulateError::BoardDoesNotFit { frame, width, height, distance_mm: distance })
    }

    /// A rotation and the ray to the board's middle. The tilt is scaled by `ease`.
    fn attitude(&self, ease: f64, rng: &mut impl Rng) -> Option<(Rotation3<f64>, [f64; 2])> {
        let Placement { max_tilt_deg, max_roll_deg, region, .. } = self.placement;
        let within = |a: f64, b: f64, rng: &mut dyn FnMut() -> f64| a + (b - a) * rng();
        let mut uniform = || rng.random::<f64>();
        let u = within(region[0], region[2], &mut uniform) * self.camera.width as f64;
        let v = within(region[1], region[3], &mut uniform) * self.camera.height as f64;
        let tilt = (max_tilt_deg * ease * uniform().powf(0.7)).to_radians();
        let direction = uniform() * std::f64::consts::TAU;
        let mut roll = (within(-1.0, 1.0, &mut uniform) * max_roll_deg).to_radians();
        // Some frames have the board on its side. Only asymmetric grids show which way up they are.
        if matches!(self.board.pattern, crate::board::Pattern::AsymmetricCircles { .. }) && uniform() < 0.3 {
            roll += std::f64::consts::FRAC_PI_2 * if uniform() < 0.5 { 1.0 } else { -1.0 };
        }
        let axis = Vector3::new(direction.cos(), direction.sin(), 0.0);
        let rotation = Rotation3::new(axis * tilt) * Rotation3::new(Vector3::new(0.0, 0.0, roll));
        let ray = self.optics.ray([u, v], 0.001)?;
        // At grazing views neither dots nor depth can be measured.
        let towards = Vector3::new(ray[0], ray[1], 1.0).normalize();
        let cosine = (rotation * Vector3::z()).dot(&towards);
        (cosine > 60f64.to_radians().cos()).then_some((rotation, ray))
    }

    fn at(&self, rotation: Rotation3<f64>, [x, y]: [f64; 2], distance: f64) -> Pose {
        let [cx, cy] = self.board.centre();
        Pose::new(rotation, Vector3::new(x, y, 1.0) * distance - rotation * Vector3::new(cx, cy, 0.0))
    }

    /// The pose moved towards the image's border in a random direction as far as it fits.
    fn towards_border(&self, rotation: Rotation3<f64>, ray: [f64; 2], distance: f64, rng: &mut impl Rng) -> Pose {
        let angle = rng.random::<f64>() * std::f64::consts::TAU;
        let pose = |s: f64| self.at(rotation, [ray[0] + s * angle.cos(), ray[1] + s * angle.sin()], distance);
        let [u0, v0, u1, v1] = self.placement.region;
        let allowed = |s: f64| {
            let [cx, cy] = self.board.centre();
            self.fits(&pose(s))
                && self.optics.project(pose(s).apply([cx, cy, 0.0])).is_some_and(|[u, v]| {
                    let (u, v) = (u / self.camera.width as f64, v / self.camera.height as f64);
                    u >= u0 && u <= u1 && v >= v0 && v <= v1
                })
        };
        let (mut inside, mut outside) = (0.0, 1.0);
        for _ in 0..12 {
            let middle = (inside + outside) / 2.0;
            if allowed(middle) { inside = middle } else { outside = middle }
        }
        pose(inside)
    }

    /// Whether the print, extended by half a spacing, lies within the image.
    fn fits(&self, pose: &Pose) -> bool {
        const MARGIN: f64 = 4.0;
        let [x0, y0, x1, y1] = self.board.print_rectangle();
        let grow = self.board.spacing_mm / 2.0;
        let steps = [0.0, 0.5, 1.0];
        steps.iter().flat_map(|&i| steps.map(|j| (i, j))).all(|(i, j)| {
            let x = x0 - grow + i * (x1 - x0 + 2.0 * grow);
            let y = y0 - grow + j * (y1 - y0 + 2.0 * grow);
            let p = pose.apply([x, y, 0.0]);
            p[2] > 120.0
                && self.optics.project(p).is_some_and(|[u, v]| {
                    u >= MARGIN
                        && v >= MARGIN
                        && u <= self.camera.width as f64 - 1.0 - MARGIN
                        && v <= self.camera.height as f64 - 1.0 - MARGIN
                })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_poses() {
        let camera = CameraTruth::published(1).unwrap();
        let board = Board::default();
        let [cx, cy] = board.centre();
        for kind in Kind::ALL {
            for seed in 0..3 {
                let poses = choose(&camera, &board, kind, kind.frames(), seed).unwrap();
                assert_eq!(poses.len(), kind.frames());
                let placement = kind.placement();
                for pose in &poses {
                    let middle = pose.apply([cx, cy, 0.0]);
                    assert!(middle[2] >= placement.near_mm - 1.0 && middle[2] <= 1.5 * placement.far_mm);
                    assert!(pose.tilt().to_degrees() <= placement.max_tilt_deg + 1e-9);
                }
            }
        }
    }

    #[test]
    fn general_reaches_the_border_and_all_distances() {
        let camera = CameraTruth::published(1).unwrap();
        let board = Board::default();
        let optics = Optics::new(&camera);
        let poses = choose(&camera, &board, Kind::General(1), 27, 0).unwrap();
        let pixels: Vec<[f64; 2]> = poses
            .iter()
            .flat_map(|pose| (0..board.len()).map(move |i| (pose, board.marker(i))))
            .filter_map(|(pose, [x, y])| optics.project(pose.apply([x, y, 0.0])))
            .collect();
        let spread = |axis: usize| {
            let values = pixels.iter().map(|p| p[axis]);
            (values.clone().fold(f64::INFINITY, f64::min), values.fold(0.0, f64::max))
        };
        assert!(spread(0).0 < 40.0 && spread(0).1 > 600.0, "{:?}", spread(0));
        assert!(spread(1).0 < 40.0 && spread(1).1 > 440.0, "{:?}", spread(1));
        assert!(poses.iter().any(|pose| pose.tilt().to_degrees() > 35.0));
        assert_ne!(poses, choose(&camera, &board, Kind::General(2), 27, 0).unwrap());
    }

    #[test]
    fn a_board_that_is_too_large_is_an_error() {
        let camera = CameraTruth::published(1).unwrap();
        let board = Board::new(crate::board::Pattern::Chessboard, 20, 20, 200.0);
        let error = choose(&camera, &board, Kind::Sameheight2, 3, 0).unwrap_err();
        assert!(matches!(error, SimulateError::BoardDoesNotFit { frame: 0, .. }), "{error}");
    }
}
