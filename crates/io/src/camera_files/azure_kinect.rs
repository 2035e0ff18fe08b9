//! The factory calibration of the Azure Kinect and the Femto, as recordings carry it and `import` keeps it.
//!
//! `CalibrationInformation.Cameras` has a camera for each sensor, with `Purpose` and 14 `Intrinsics.ModelParameters`: cx cy fx fy
//! k1 k2 k3 k4 k5 k6 codx cody p2 p1. The first four are shares of the sensor's full width and height, with the corner of the
//! first pixel at 0; a mode of the camera is the sensor, binned to a size and cropped. A camera of such a file therefore has the
//! name of its mode: `colour-1920x1080`, `depth-640x576`.
//!
//! Source: k4a SDK, `transformation_get_mode_specific_camera_calibration`, and `transformation_project_internal`: the model
//! `BrownConrady` is OpenCV's of eight coefficients; `Rational6KT` has p1 x y in place of 2 p1 x y; codx and cody displace the
//! centre of the distortion, and are 0 for `BrownConrady`.

use super::error::CameraFileError;
use super::intrinsics::{FileLens, Intrinsics};
use super::lens_form::needed;
use super::node::Node;

const PARAMETERS: &str = "ModelParameters";
/// Sizes of the modes of the depth camera: the binned sensor and the corner that is cut out of it, px.
const DEPTH_MODES: [([usize; 2], [f64; 2], [f64; 2]); 4] = [
    ([640, 576], [1024.0, 1024.0], [192.0, 180.0]),
    ([320, 288], [512.0, 512.0], [96.0, 90.0]),
    ([1024, 1024], [1024.0, 1024.0], [0.0, 0.0]),
    ([512, 512], [512.0, 512.0], [0.0, 0.0]),
];
/// Sizes of the modes of the colour camera, px; 1280×960 is the Femto's.
const COLOUR_MODES: [[usize; 2]; 7] =
    [[1280, 960], [1280, 720], [1920, 1080], [2560, 1440], [2048, 1536], [3840, 2160], [4096, 3072]];

/// Names of the modes of the cameras in a document.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    let Some(information) = node.node("CalibrationInformation") else { return Vec::new() };
    let named = |kind: &str, [width, height]: [usize; 2]| format!("{kind}-{width}x{height}");
    let modes = |camera: Node<'_>| match camera.text("Purpose") {
        Some("CALIBRATION_CameraPurposeDepth") => DEPTH_MODES.iter().map(|mode| named("depth", mode.0)).collect(),
        Some("CALIBRATION_CameraPurposePhotoVideo") => COLOUR_MODES.iter().map(|size| named("colour", *size)).collect(),
        _ => Vec::new(),
    };
    information.nodes("Cameras").into_iter().flat_map(modes).collect()
}

/// Reads the camera of a mode.
pub(super) fn read(node: &Node<'_>, name: &str) -> Result<Intrinsics, CameraFileError> {
    let no_mode = || node.fault("CalibrationInformation", format!("has no camera of the mode '{name}'"));
    let (kind, size) = name.split_once('-').ok_or_else(no_mode)?;
    let (width, height) = size.split_once('x').ok_or_else(no_mode)?;
    let size = [width, height].map(|side| side.parse::<usize>().ok());
    let [Some(width), Some(height)] = size else { return Err(no_mode()) };
    let (purpose, mode) = match kind {
        "depth" => {
            let mode = DEPTH_MODES.iter().find(|mode| mode.0 == [width, height]);
            ("CALIBRATION_CameraPurposeDepth", mode.map(|(_, binned, corner)| (*binned, *corner)))
        }
        // 4:3 is the sensor; 16:9 leaves out rows above and below.
        _ => {
            let binned = [width as f64, 0.75 * width as f64];
            let mode = (height as f64 <= binned[1]).then_some((binned, [0.0, (binned[1] - height as f64) / 2.0]));
            ("CALIBRATION_CameraPurposePhotoVideo", mode)
        }
    };
    let cameras = node.node("CalibrationInformation").map_or_else(Vec::new, |n| n.nodes("Cameras"));
    let camera = cameras.into_iter().find(|camera| camera.text("Purpose") == Some(purpose)).ok_or_else(no_mode)?;
    let (binned, corner) = mode.ok_or_else(no_mode)?;
    let intrinsics = camera.node("Intrinsics").ok_or_else(|| camera.fault("Intrinsics", "is missing"))?;
    let p = intrinsics.array::<14>(PARAMETERS)?;
    intrinsics.focal_lengths(PARAMETERS, [p[2], p[3]])?;
    let scaled = |i: usize, axis: usize| p[i] * binned[axis] - corner[axis] - 0.5;
    let pinhole = [p[2] * binned[0], p[3] * binned[1], scaled(0, 0), scaled(1, 1), 0.0];
    Ok(Intrinsics { size: Some([width, height]), pinhole, lens: Some(lens(&intrinsics, &p)?) })
}

/// k1 k2 p1 p2 k3 k4 k5 k6 in OpenCV's order, the first five where the others are zero.
fn lens(node: &Node<'_>, p: &[f64; 14]) -> Result<FileLens, CameraFileError> {
    let model = node.required_text("ModelType")?;
    let is_rational = model.ends_with("Rational6KT");
    if !is_rational && !model.ends_with("BrownConrady") {
        return Err(node.unsupported(model, "CALIBRATION_LensDistortionModelBrownConrady and Rational6KT"));
    }
    if is_rational && [p[12], p[13]] != [0.0; 2] {
        let problem = "has p1 and p2 of Rational6KT, whose decentring is not OpenCV's: calibrate the camera instead";
        return Err(node.fault(PARAMETERS, problem));
    }
    if [p[10], p[11]] != [0.0; 2] {
        let problem =
            "displaces the centre of the distortion (codx, cody), which is not read: calibrate the camera instead";
        return Err(node.fault(PARAMETERS, problem));
    }
    let k = [p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]];
    let piece = if needed(&k) > 5 { "opencv_lens" } else { "brown_conrady" };
    Ok(FileLens { piece, values: k[..if needed(&k) > 5 { 8 } else { 5 }].to_vec() })
}
