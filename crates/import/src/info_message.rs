//! `sensor_msgs/CameraInfo`.

use crate::camera_info::CameraInfo;
use crate::fields::Fields;

/// Reads a message of an image that is reduced and cut out as it says.
///
/// # Errors
/// That the message is cut off, that the camera was not calibrated, or that its numbers are no camera's.
pub(crate) fn read(fields: Fields<'_>) -> Result<CameraInfo, String> {
    let info = whole(fields).ok_or("a message is cut off or not of its type")?;
    if info.pinhole[..2] == [0.0; 2] {
        return Err("its focal lengths are zero: the driver has no calibration".to_owned());
    }
    if !info.is_plausible() {
        let [fx, fy, cx, cy] = info.pinhole;
        return Err(format!("focal lengths of {fx}, {fy} px and the centre {cx}, {cy} px are no camera's"));
    }
    Ok(info)
}

/// `sensor_msgs/CameraInfo`. K is of the whole image; binning divides it, after the region of interest was cut out
/// (image_geometry's PinholeCameraModel).
fn whole(mut fields: Fields<'_>) -> Option<CameraInfo> {
    fields.header()?;
    let (height, width) = (fields.u32()? as usize, fields.u32()? as usize);
    let model = fields.string()?;
    let distortion = fields.f64s()?;
    let mut k = [0.0; 9];
    for entry in &mut k {
        *entry = fields.f64()?;
    }
    // R and P are of rectified images.
    for _ in 0..9 + 12 {
        fields.f64()?;
    }
    let binning = [fields.u32()?, fields.u32()?].map(|b| b.max(1) as usize);
    let [left, top, roi_height, roi_width] = [fields.u32()?, fields.u32()?, fields.u32()?, fields.u32()?];
    let size = |roi: u32, whole: usize| if roi == 0 { whole } else { roi as usize };
    let (width, height) = (size(roi_width, width) / binning[0], size(roi_height, height) / binning[1]);
    let [bx, by] = binning.map(|b| b as f64);
    let pinhole = [k[0] / bx, k[4] / by, (k[2] - f64::from(left)) / bx, (k[5] - f64::from(top)) / by];
    Some(CameraInfo { width, height, model, distortion, pinhole })
}
