//! A board that is waved in front of the cameras while they take a video.

use crate::board::Board;
use crate::pose::Pose;

/// Cycles per second of the board's turns about x, y, z and of its shifts along them. No two have a ratio of small numbers, so
/// that the board is nowhere twice.
const CYCLES_PER_S: [f64; 6] = [0.31, 0.37, 0.23, 0.29, 0.41, 0.19];
/// Where in its cycle each begins, cycles.
const BEGINNING: [f64; 6] = [0.1, 0.35, 0.6, 0.85, 0.2, 0.7];

/// A video of a board that is waved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waved {
    /// Time between frames, s.
    pub period_s: f64,
    /// Distance of the board's middle on average, mm.
    pub distance_mm: f64,
    /// Largest turns about x, y and z, rad.
    pub turn_rad: [f64; 3],
    /// Largest shifts along x, y and z, mm.
    pub shift_mm: [f64; 3],
}

impl Default for Waved {
    /// As a hand does it, at 25 frames per second.
    fn default() -> Self {
        Self { period_s: 0.04, distance_mm: 800.0, turn_rad: [0.5, 0.5, 0.3], shift_mm: [120.0, 90.0, 250.0] }
    }
}

impl Waved {
    /// Pose of the board in the rig's frame at a time, s.
    pub(super) fn pose(&self, board: &Board, time_s: f64) -> Pose {
        let wave = |i: usize| (std::f64::consts::TAU * (CYCLES_PER_S[i] * time_s + BEGINNING[i])).sin();
        let [x, y] = board.centre();
        let middle = [x, y, 0.0];
        let facing = Pose::from_rotation_vector([0.0; 3], [-middle[0], -middle[1], self.distance_mm]);
        let shift = [0, 1, 2].map(|i| self.shift_mm[i] * wave(3 + i));
        let turn = [0, 1, 2].map(|i| self.turn_rad[i] * wave(i));
        facing.nudged(middle, shift, turn)
    }
}
