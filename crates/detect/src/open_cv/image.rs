//! Images for OpenCV, and its coordinates in ours.

use opencv::core::{Mat, Point2f, Size};
use opencv::imgproc;

use super::context::Context;
use crate::error::DetectError;
use crate::stretch::Plane;

/// A plane as 8 bits, enlarged `scale` times.
pub(super) fn to_mat(plane: &Plane, scale: usize) -> Result<Mat, DetectError> {
    let bytes = plane.to_bytes();
    let mat = Mat::new_rows_cols_with_data(plane.height as i32, plane.width as i32, &bytes).context("Mat")?;
    let mut scaled = Mat::default();
    let size = Size::new((plane.width * scale) as i32, (plane.height * scale) as i32);
    imgproc::resize(&mat, &mut scaled, size, 0.0, 0.0, imgproc::INTER_CUBIC).context("resize")?;
    Ok(scaled)
}

/// Coordinates in an image, from those in the image enlarged `scale` times.
pub(super) fn unscaled(pixel: Point2f, scale: usize) -> [f64; 2] {
    [pixel.x, pixel.y].map(|v| (f64::from(v) + 0.5) / scale as f64 - 0.5)
}
