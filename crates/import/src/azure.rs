//! The factory calibration that recordings of the Azure Kinect and the Femto carry as `calibration.json`.

use std::path::Path;

use depthcal_io::camera_files::parse_camera;

use crate::camera_info::CameraInfo;

/// Coefficients of ROS' `rational_polynomial`.
const COEFFICIENTS: usize = 8;

/// Intrinsics of a stream of `size`, of the depth camera or of the colour camera; `None` where the calibration has no such mode,
/// or a lens that is not read.
pub(crate) fn camera_info(calibration: &[u8], [width, height]: [usize; 2], is_depth: bool) -> Option<CameraInfo> {
    let text = std::str::from_utf8(calibration).ok()?;
    let mode = format!("{}-{width}x{height}", if is_depth { "depth" } else { "colour" });
    let camera = parse_camera(Path::new("calibration.json"), text, Some(&mode)).ok()?;
    let [fx, fy, cx, cy, _] = camera.pinhole;
    let mut distortion = camera.lens?.values;
    distortion.resize(COEFFICIENTS, 0.0);
    let (model, pinhole) = ("rational_polynomial".to_owned(), [fx, fy, cx, cy]);
    Some(CameraInfo { width, height, model, distortion, pinhole }).filter(CameraInfo::is_plausible)
}
