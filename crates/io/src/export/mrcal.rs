//! mrcal's .cameramodel.

use super::camera::ExportCamera;
use super::error::ExportError;
use super::outcome::Export;
use super::text::list;

/// A .cameramodel, which is a Python dictionary.
///
/// | key | contents |
/// |---|---|
/// | `lensmodel` | `LENSMODEL_OPENCV5` |
/// | `intrinsics` | fx fy cx cy, then k1 k2 p1 p2 k3 |
/// | `extrinsics` | rt_cam_ref, zeros: the camera is its own reference |
/// | `imagersize` | width, height in px |
///
/// Skew, depth model and further lens pieces give warnings.
///
/// # Errors
/// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
pub fn mrcal_cameramodel(camera: &ExportCamera) -> Result<Export, ExportError> {
    camera.check()?;
    let mut intrinsics = vec![camera.fx, camera.fy, camera.cx, camera.cy];
    intrinsics.extend(camera.distortion);
    let text = format!(
        "{{\n    'lensmodel': 'LENSMODEL_OPENCV5',\n\n\
         \x20   # fx, fy, cx, cy, k1, k2, p1, p2, k3\n    'intrinsics': {},\n\n\
         \x20   # rt_cam_ref\n    'extrinsics': {},\n\n    'imagersize': [{}, {}],\n}}\n",
        list(&intrinsics),
        list(&[0.0; 6]),
        camera.width,
        camera.height
    );
    Ok(Export { text, warnings: camera.losses("mrcal") })
}
