//! A rig held against the evidence that it came from: the noise that its cameras have in the joint fit against that of the same
//! cameras alone.

use depthcal_statistics::{rms, upper_median};
use nalgebra::Point3;

use super::calibrated::{Calibrated, CameraFit};
use crate::calibrate::{CalibrateError, RigContradiction};

/// Noise of a camera in a rig over that alone from which on the cameras contradict each other …
const CONTRADICTS: f64 = 3.0;
/// … where it is this large, px.
const LEAST_PX: f64 = 0.3;
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
    fn ratio(camera: &CameraFit) -> Option<(f64, &CameraFit, f64)> {
        let (alone_px, joint_px) = (camera.alone_px?, camera.calibrated.noise.pixel_sigma);
        (joint_px > LEAST_PX && joint_px > CONTRADICTS * alone_px).then_some((joint_px / alone_px, camera, alone_px))
    }
    let most = rig.cameras.iter().filter_map(ratio).max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, camera, alone_px)) = most else { return Ok(()) };
    let (camera_name, joint_px) = (camera.name.clone(), camera.calibrated.noise.pixel_sigma);
    Err(CalibrateError::RigContradiction(Box::new(RigContradiction {
        camera: camera_name,
        joint_px,
        alone_px,
        frames: standing_out(camera),
    })))
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
