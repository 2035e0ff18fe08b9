//! A rig held against the evidence that it came from: noise and focal lengths of its cameras in the joint fit against those that
//! their images say alone.

use depthcal_statistics::{rms, upper_median};
use nalgebra::Point3;

use super::calibrated::{Calibrated, CameraFit, ImagesAlone};
use crate::calibrate::{CalibrateError, Evidence, RigContradiction};

/// Noise of a camera in a rig over that alone from which on the cameras contradict each other …
const CONTRADICTS: f64 = 3.0;
/// … where it is this large, px.
const LEAST_PX: f64 = 0.3;
/// Focal lengths in the joint fit and alone contradict each other where they are this many standard deviations apart …
const DEVIATIONS: f64 = 6.0;
/// … and this share: what a bent board, which all cameras see, may change them by is less.
const LEAST_APART: f64 = 0.03;
/// A frame is named where its reprojection error is this many times the median frame's.
const STANDS_OUT: f64 = 3.0;
/// Frames that a message names.
const NAMED: usize = 6;

/// Refuses a rig whose joint fit contradicts those of its cameras alone.
///
/// # Errors
///
/// [`CalibrateError::RigContradiction`] with the camera that is contradicted most.
pub(crate) fn check_evidence(rig: &Calibrated) -> Result<(), CalibrateError> {
    let contradicted = rig.cameras.iter().filter_map(|camera| {
        let alone = camera.alone.as_ref()?;
        let (ratio, evidence) = noise(camera, alone).or_else(|| focal_length(camera, alone))?;
        Some((ratio, camera, evidence))
    });
    let Some((_, camera, evidence)) = contradicted.max_by(|a, b| a.0.total_cmp(&b.0)) else { return Ok(()) };
    let (name, frames) = (camera.name.clone(), standing_out(camera));
    Err(CalibrateError::RigContradiction(Box::new(RigContradiction { camera: name, evidence, frames })))
}

/// The noise of a camera where it contradicts, and how often it is what the limit allows.
fn noise(fit: &CameraFit, alone: &ImagesAlone) -> Option<(f64, Evidence)> {
    let (alone_px, joint_px) = (alone.noise_px, fit.calibrated.noise.pixel_sigma);
    let ratio = joint_px / LEAST_PX.max(CONTRADICTS * alone_px);
    (ratio > 1.0).then_some((ratio, Evidence::Noise { joint_px, alone_px }))
}

/// The focal length of a camera where it contradicts, and how often its difference is what the limit allows.
fn focal_length(fit: &CameraFit, alone: &ImagesAlone) -> Option<(f64, Evidence)> {
    let (alone_px, joint_px) = (alone.focal_px?, fit.calibrated.focal_length()?);
    let ratio = (joint_px[0] - alone_px[0]).abs() / most_apart_px(alone_px, joint_px);
    (ratio > 1.0).then_some((ratio, Evidence::FocalLength { joint_px, alone_px }))
}

/// Largest difference of two focal lengths, each with its standard deviation, that says nothing, px.
fn most_apart_px([alone, alone_std]: [f64; 2], [_, joint_std]: [f64; 2]) -> f64 {
    (DEVIATIONS * alone_std.hypot(joint_std)).max(LEAST_APART * alone)
}

/// The frames whose markers are far from where the joint fit has them, the worst first.
fn standing_out(camera: &CameraFit) -> Vec<String> {
    let capture = &camera.calibrated.capture;
    let error = |frame: &crate::observe::SampledFrame| {
        let distances = frame.markers.iter().filter_map(|marker| {
            let p = camera.calibrated.camera.board_point(capture.target.point(marker.index));
            let [u, v] = camera.calibrated.camera.project(&(frame.camera_from_board * Point3::from(p)).coords)?;
            Some((u - marker.pixel[0]).hypot(v - marker.pixel[1]))
        });
        rms(distances)
    };
    let mut errors: Vec<(f64, &str)> = capture.frames.iter().map(|frame| (error(frame), frame.name.as_str())).collect();
    let Some(median) = upper_median(&mut errors.iter().map(|(error, _)| *error).collect::<Vec<_>>()) else {
        return Vec::new();
    };
    errors.retain(|(error, _)| *error > STANDS_OUT * median);
    errors.sort_by(|a, b| b.0.total_cmp(&a.0));
    errors.into_iter().take(NAMED).map(|(_, name)| name.to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn focal_lengths_contradict_beyond_their_deviations_and_what_boards_change() {
        assert_eq!(most_apart_px([500.0, 3.0], [520.0, 4.0]), 30.0);
        assert_eq!(most_apart_px([500.0, 0.1], [520.0, 0.1]), 15.0);
    }
}
