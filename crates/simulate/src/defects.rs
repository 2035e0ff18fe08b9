//! Faults of a capture that are not effects: wrong frames, outliers, wrong declarations.

use nalgebra::Vector3;
use rand::{RngExt, seq::SliceRandom};
use serde::{Deserialize, Serialize};

use crate::board::Board;
use crate::conditions::Conditions;
use crate::error::{SimulateError, check};
use crate::pose::Pose;
use crate::streams::{Purpose, stream};

/// Defects of a capture. The default has none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Defects {
    /// Number of frames in which the board moved by 10 to 25 mm and 1° to 3° between image and depth.
    pub bad_frames: usize,
    /// Number of frames that are copies, image and depth, of the frame before them.
    pub duplicated_frames: usize,
    /// Number of pairs of frames whose depth images are exchanged.
    pub swapped_depth_pairs: usize,
    /// Share of the depth values that are wrong by 20 to 200 mm.
    pub depth_outliers: f64,
    /// Share of the markers that are wrong by 2 to 20 px; applies to point observations only.
    pub marker_outliers: f64,
    /// Declared spacing of the board divided by the true one.
    pub spacing_factor: f64,
    /// Declared unit of the depth images divided by the true one.
    pub depth_unit_factor: f64,
}

impl Default for Defects {
    fn default() -> Self {
        Self {
            bad_frames: 0,
            duplicated_frames: 0,
            swapped_depth_pairs: 0,
            depth_outliers: 0.0,
            marker_outliers: 0.0,
            spacing_factor: 1.0,
            depth_unit_factor: 1.0,
        }
    }
}

/// Indices of the frames with defects.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct DefectiveFrames {
    /// Frames in which the board moved between image and depth.
    pub bad: Vec<usize>,
    /// Pairs [original, copy].
    pub duplicated: Vec<[usize; 2]>,
    /// Pairs whose depth images are exchanged.
    pub swapped: Vec<[usize; 2]>,
}

/// One exposure: the pose of the board, and the source of noise and conditions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shot {
    pub pose: Pose,
    /// Index of the frame whose random streams are used.
    pub source: usize,
    pub conditions: Conditions,
}

/// The exposures of image and depth image of a frame, and the conditions that the dataset declares.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub declared: Conditions,
    pub image: Shot,
    pub depth: Shot,
}

impl Defects {
    pub(crate) fn check(&self, frames: usize) -> Result<(), SimulateError> {
        let hit = self.bad_frames + 2 * self.duplicated_frames + 2 * self.swapped_depth_pairs;
        if hit > frames {
            let expected = "no more defective frames than the dataset has";
            return Err(SimulateError::BadParameter { field: "defects", value: hit as f64, expected });
        }
        let shares =
            [("defects.depth_outliers", self.depth_outliers), ("defects.marker_outliers", self.marker_outliers)];
        check(shares, "a share from 0 to 1", |value| (0.0..=1.0).contains(&value))?;
        let factors =
            [("defects.spacing_factor", self.spacing_factor), ("defects.depth_unit_factor", self.depth_unit_factor)];
        check(factors, "a positive factor", |value| value > 0.0)
    }

    /// The frames with their defects, at most one per frame.
    pub(crate) fn frames(
        &self,
        poses: &[Pose],
        conditions: &[Conditions],
        board: &Board,
        seed: u64,
    ) -> (Vec<Frame>, DefectiveFrames) {
        let mut rng = stream(seed, Purpose::Defects, 0);
        let shot = |i: usize| Shot { pose: poses[i], source: i, conditions: conditions[i] };
        let mut frames: Vec<Frame> =
            (0..poses.len()).map(|i| Frame { declared: conditions[i], image: shot(i), depth: shot(i) }).collect();
        let mut hit = DefectiveFrames::default();

        // Duplicates come first, as they need pairs of neighbours.
        let mut free = vec![true; frames.len()];
        let mut pairs: Vec<usize> = (1..frames.len()).collect();
        pairs.shuffle(&mut rng);
        for copy in pairs {
            if hit.duplicated.len() == self.duplicated_frames {
                break;
            }
            if free[copy] && free[copy - 1] {
                (free[copy], free[copy - 1]) = (false, false);
                frames[copy] = Frame { declared: frames[copy].declared, ..frames[copy - 1] };
                hit.duplicated.push([copy - 1, copy]);
            }
        }
        let mut sound: Vec<usize> = (0..frames.len()).filter(|&i| free[i]).collect();
        sound.shuffle(&mut rng);
        let mut sound = sound.into_iter();
        while hit.swapped.len() < self.swapped_depth_pairs {
            let (Some(a), Some(b)) = (sound.next(), sound.next()) else { break };
            (frames[a].depth, frames[b].depth) = (frames[b].depth, frames[a].depth);
            hit.swapped.push([a, b]);
        }
        for bad in sound.take(self.bad_frames) {
            let [cx, cy] = board.centre();
            let mut direction =
                || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).try_normalize(1e-6).unwrap_or(Vector3::x());
            let (shift, turn) = (direction(), direction());
            let shift = shift * rng.random_range(10.0..25.0);
            let turn = turn * rng.random_range(1f64..3.0).to_radians();
            frames[bad].depth.pose = frames[bad].image.pose.nudged([cx, cy, 0.0], shift.into(), turn.into());
            hit.bad.push(bad);
        }
        hit.bad.sort_unstable();
        (frames, hit)
    }
}
