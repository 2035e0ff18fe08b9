//! All frames of one camera at one stage.

use depthcal_io::{Disparity, DroppedFrame};
use depthcal_model::{Target, Technology};
use nalgebra::Isometry3;

use super::stages::{AdjustableFrame, DetectedFrame};

/// The frames of one camera at one stage; without a type argument, those in which the board was detected.
#[derive(Debug, Clone)]
pub struct CameraFrames<F = DetectedFrame> {
    /// The dataset's name.
    pub name: String,
    /// The board.
    pub target: Target,
    /// Width of the images, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Millimetres per step of the depth images, where there are any.
    pub depth_unit_mm: Option<f64>,
    /// How the disparities that its files hold become depth; the frames have depth in mm then.
    pub disparity: Option<Disparity>,
    /// The principle by which the camera measures depth, where it is declared.
    pub technology: Option<Technology>,
    /// The frames.
    pub frames: Vec<F>,
    /// Frames that are not used.
    pub dropped: Vec<DroppedFrame>,
}

impl<F: Clone> CameraFrames<F> {
    /// This capture with only those frames for which `keep` (given their position) is true.
    pub fn subset(&self, keep: impl Fn(usize, &F) -> bool) -> Self {
        let frames = self.frames.iter().enumerate().filter(|(i, f)| keep(*i, f)).map(|(_, f)| f.clone()).collect();
        self.with_frames(frames)
    }
}

impl<F> CameraFrames<F> {
    /// This camera's capture with other frames, for example those of another stage.
    pub fn with_frames<G>(&self, frames: Vec<G>) -> CameraFrames<G> {
        CameraFrames {
            name: self.name.clone(),
            target: self.target.clone(),
            width: self.width,
            height: self.height,
            depth_unit_mm: self.depth_unit_mm,
            disparity: self.disparity,
            technology: self.technology,
            frames,
            dropped: self.dropped.clone(),
        }
    }
}

impl<F: AsRef<DetectedFrame>> CameraFrames<F> {
    /// Whether any frame has depth.
    pub fn has_depth(&self) -> bool {
        self.frames.iter().any(|f| f.as_ref().has_depth())
    }

    /// The frames as they were detected.
    pub fn detected(&self) -> CameraFrames {
        self.with_frames(self.frames.iter().map(|f| f.as_ref().clone()).collect())
    }
}

impl<F: AdjustableFrame> CameraFrames<F> {
    /// Sets the pose of every frame.
    pub fn set_poses(&mut self, poses: &[Isometry3<f64>]) {
        for (frame, pose) in self.frames.iter_mut().zip(poses) {
            frame.posed_mut().camera_from_board = *pose;
        }
    }

    /// The poses of the frames.
    pub fn poses(&self) -> impl Iterator<Item = Isometry3<f64>> + '_ {
        self.frames.iter().map(|f| f.posed().camera_from_board)
    }
}
