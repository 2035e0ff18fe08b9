//! Kalibr's camchain.

use super::camera::ExportCamera;
use super::error::ExportError;
use super::outcome::{Export, ExportWarning};
use super::text::list;

/// A camchain with one camera, `cam0`, as Kalibr writes and reads it.
///
/// | key | contents |
/// |---|---|
/// | `cam_overlaps` | empty: one camera |
/// | `camera_model`, `intrinsics` | `pinhole`, fx fy cx cy |
/// | `distortion_model`, `distortion_coeffs` | `radtan`, k1 k2 p1 p2 |
/// | `resolution` | width, height in px |
/// | `rostopic` | `/cam0/image_raw`; rename it to the camera's topic |
///
/// radtan has no k3: a k3 other than 0 gives a warning, as do skew, depth model and further lens pieces.
///
/// # Errors
/// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
pub fn kalibr_camchain(camera: &ExportCamera) -> Result<Export, ExportError> {
    const FORMAT: &str = "Kalibr";
    camera.check()?;
    let [k1, k2, p1, p2, k3] = camera.distortion;
    let text = format!(
        "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: {}\n  distortion_model: radtan\n  \
         intrinsics: {}\n  resolution: [{}, {}]\n  rostopic: /cam0/image_raw\n",
        list(&[k1, k2, p1, p2]),
        list(&[camera.fx, camera.fy, camera.cx, camera.cy]),
        camera.width,
        camera.height
    );
    let mut warnings = camera.losses(FORMAT);
    if k3 != 0.0 {
        warnings.push(ExportWarning::Distortion { format: FORMAT, coefficient: "k3", value: k3 });
    }
    Ok(Export { text, warnings })
}
