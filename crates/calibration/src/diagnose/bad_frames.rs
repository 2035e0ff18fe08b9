//! Frames that do not belong to the others: the board moved between image and depth, depth images were exchanged, or a frame is
//! stored twice.
//!
//! They are excluded because they imitate effects: a frame whose depth belongs to another pose distorts the estimate of
//! everything that varies with pose.

use depthcal_statistics::{Thinning, upper_median};
use nalgebra::Isometry3;

use super::frame_planes::FramePlane;
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;
use crate::observe::board_pixels::{BoardPixel, BoardPixels, board_area_px, board_pixels};
use crate::observe::board_region::BoardRegion;
use crate::observe::{CameraFrames, DetectedFrame, PixelRays};

/// Most pixels of a depth image that are compared with the board, about.
const MOST_PIXELS: usize = 4000;

/// An excluded frame.
#[derive(Debug, Clone, PartialEq)]
pub struct BadFrame {
    /// The frame.
    pub name: String,
    /// Why it is excluded.
    pub reason: BadFrameReason,
}

/// Why a frame is excluded.
#[derive(Debug, Clone, PartialEq)]
pub enum BadFrameReason {
    /// Its depth image fits the pose of another excluded frame: the two depth images seem to be exchanged.
    DepthExchanged {
        /// The other frame.
        with: String,
    },
    /// Its depth deviates from its image by a plane: the board or the camera seems to have moved between the two.
    Moved {
        /// Mean of the plane, mm of depth.
        offset_mm: f64,
        /// Root mean square of the plane, mm of depth.
        rms_mm: f64,
    },
    /// It has the image of an earlier frame.
    SameImage {
        /// The earlier frame.
        of: String,
    },
    /// It has the depth image of an earlier frame.
    SameDepthImage {
        /// The earlier frame.
        of: String,
    },
}

/// The reasons for frames with outlying planes: depth images that are exchanged among these frames, or else a movement.
pub fn explain(fit: &CalibratedCamera, bad: &[&FramePlane], thresholds: &Thresholds) -> Vec<BadFrame> {
    let rays = PixelRays::new(&fit.camera, &fit.capture.target);
    let deviation = |frame: usize, pose: &Isometry3<f64>| deviation(fit, &rays, frame, pose);
    let pose_of = |i: usize| fit.capture.frames[i].camera_from_board;
    let find = |name: &str| fit.capture.frames.iter().position(|f| f.name == name);
    let indices: Vec<usize> = bad.iter().filter_map(|p| find(&p.name)).collect();
    bad.iter()
        .map(|plane| {
            let index = find(&plane.name);
            // The bad frame whose pose fits this depth image best.
            let partner = index.and_then(|index| {
                let before = deviation(index, &pose_of(index))?;
                let others = indices.iter().filter(|i| **i != index);
                others
                    .filter_map(|i| Some((*i, deviation(index, &pose_of(*i))?)))
                    .filter(|(_, after)| *after < thresholds.exchanged_deviation_ratio * before)
                    .min_by(|a, b| a.1.total_cmp(&b.1))
            });
            let reason = match partner {
                Some((other, _)) => BadFrameReason::DepthExchanged { with: fit.capture.frames[other].name.clone() },
                None => BadFrameReason::Moved { offset_mm: plane.offset_mm, rms_mm: plane.rms_mm },
            };
            BadFrame { name: plane.name.clone(), reason }
        })
        .collect()
}

/// Median absolute deviation of a frame's depth image from the board in a pose, mm; `None` without depth on that board.
fn deviation(fit: &CalibratedCamera, rays: &PixelRays<'_>, frame: usize, pose: &Isometry3<f64>) -> Option<f64> {
    let region = BoardRegion::new(&fit.capture.target);
    let unit_mm = fit.capture.depth_unit_mm?;
    // Only how the exclusion is explained depends on it: an image that cannot be read any more explains nothing.
    let open = fit.capture.frames[frame].open().ok()?;
    let thinning = Thinning::new(board_area_px(&fit.camera, &region, pose), MOST_PIXELS);
    let BoardPixels { pixels, covariates } = board_pixels(&open, unit_mm, rays, &region, pose, thinning);
    let corrected = |p: &BoardPixel| {
        let corrected = fit.camera.correct(&covariates.context(p.number, p.pixel), p.cos_incidence, 1.0 / p.depth_mm);
        Some(1.0 / corrected.ok()?.1)
    };
    let mut deviations: Vec<f64> =
        pixels.iter().filter_map(|p| corrected(p).map(|z| (z - p.board_depth_mm).abs())).collect();
    upper_median(&mut deviations)
}

/// The capture without frames that copy an earlier one, with the same markers to the last digit or the same depth image; and
/// the copies.
pub fn without_duplicates(capture: &CameraFrames, thresholds: &Thresholds) -> (CameraFrames, Vec<BadFrame>) {
    let mut bad = Vec::new();
    let mut unique: Vec<&DetectedFrame> = Vec::new();
    let same_markers = |a: &DetectedFrame, b: &DetectedFrame| {
        a.markers.len() >= thresholds.least_identical_markers
            && a.markers.len() == b.markers.len()
            && a.markers.iter().zip(&b.markers).all(|(m, n)| m.index == n.index && m.pixel == n.pixel)
    };
    for frame in &capture.frames {
        let earlier = unique.iter().find(|k| same_markers(k, frame) || k.has_depth_of(frame));
        match earlier {
            Some(earlier) => {
                let original = earlier.name.clone();
                let reason = if same_markers(earlier, frame) {
                    BadFrameReason::SameImage { of: original }
                } else {
                    BadFrameReason::SameDepthImage { of: original }
                };
                bad.push(BadFrame { name: frame.name.clone(), reason });
            }
            None => unique.push(frame),
        }
    }
    (capture.subset(|_, f| bad.iter().all(|b| b.name != f.name)), bad)
}
