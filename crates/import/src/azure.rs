//! The factory calibration that recordings of the Azure Kinect and the Femto carry as `calibration.json`.

use serde::Deserialize;

use crate::camera_info::CameraInfo;

#[derive(Deserialize)]
struct File {
    #[serde(rename = "CalibrationInformation")]
    information: Information,
}

#[derive(Deserialize)]
struct Information {
    #[serde(rename = "Cameras")]
    cameras: Vec<Camera>,
}

#[derive(Deserialize)]
struct Camera {
    #[serde(rename = "Purpose")]
    purpose: String,
    #[serde(rename = "Intrinsics")]
    intrinsics: Intrinsics,
}

#[derive(Deserialize)]
struct Intrinsics {
    #[serde(rename = "ModelParameters")]
    parameters: Vec<f64>,
    #[serde(rename = "ModelType")]
    model: String,
}

/// Intrinsics of a stream of `size`, of the depth camera or of the colour camera.
///
/// Parameters are shares of the sensor's full width and height, with the corner of the first pixel at 0; a mode is the sensor,
/// binned to a size, and cropped (k4a SDK, `transformation_get_mode_specific_camera_calibration`). Order of the parameters: cx cy
/// fx fy k1 … k6 codx cody p2 p1.
pub(crate) fn camera_info(calibration: &[u8], size: [usize; 2], is_depth: bool) -> Option<CameraInfo> {
    // Some writers end the text with zeros.
    let end = calibration.iter().rposition(|byte| *byte != 0)? + 1;
    let file: File = serde_json::from_slice(&calibration[..end]).ok()?;
    let purpose = if is_depth { "CALIBRATION_CameraPurposeDepth" } else { "CALIBRATION_CameraPurposePhotoVideo" };
    let intrinsics = file.information.cameras.into_iter().find(|camera| camera.purpose == purpose)?.intrinsics;
    let p = intrinsics.parameters;
    if p.len() < 14 || !intrinsics.model.contains("Brown") && !intrinsics.model.contains("Rational") {
        return None;
    }
    let [width, height] = size.map(|side| side as f64);
    // Binned width and height of the whole sensor, and the corner that is cut out of it.
    let (binned, corner) = match (is_depth, size) {
        (true, [320, 288]) => ([512.0, 512.0], [96.0, 90.0]),
        (true, [640, 576]) => ([1024.0, 1024.0], [192.0, 180.0]),
        (true, [512, 512] | [1024, 1024]) => ([width, height], [0.0, 0.0]),
        (true, _) => return None,
        // 4:3 is the sensor; 16:9 leaves out rows above and below.
        (false, _) => ([width, 0.75 * width], [0.0, (0.75 * width - height) / 2.0]),
    };
    let pinhole =
        [p[2] * binned[0], p[3] * binned[1], p[0] * binned[0] - corner[0] - 0.5, p[1] * binned[1] - corner[1] - 0.5];
    // k1 k2 p1 p2 k3 k4 k5 k6, as OpenCV and ROS order them.
    let distortion = vec![p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]];
    let model = "rational_polynomial".to_owned();
    Some(CameraInfo { width: size[0], height: size[1], model, distortion, pinhole }).filter(CameraInfo::is_plausible)
}
