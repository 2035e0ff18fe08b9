//! Colours of depth pixels.

use depthcal_io::RgbImage;
use depthcal_model::Camera;
use nalgebra::Isometry3;

use super::depth::{HIDDEN, RegisteredDepth, seen};

/// The colour of every point of a depth camera (mm, its frame, NaN where there is none), by interpolation in another camera's
/// image; `None` where there is no point, outside that image, and where another surface hides the point: `registered` is the
/// depth in that camera ([`super::depth_into`]).
pub fn colours_of(
    points: &[[f32; 3]],
    camera: &Camera,
    camera_from_depth: &Isometry3<f64>,
    registered: &RegisteredDepth,
    image: &RgbImage,
) -> Vec<Option<[u8; 3]>> {
    let (width, height) = (image.width, image.height);
    let colour = |s: &super::depth::Seen| {
        let [u, v] = s.pixel;
        let inside = u >= 0.0 && v >= 0.0 && u <= width as f32 - 1.0 && v <= height as f32 - 1.0;
        if !inside || (registered.width, registered.height) != (width, height) {
            return None;
        }
        let surface = registered.surface_mm[v.round() as usize * width + u.round() as usize];
        if surface > 0.0 && s.depth_mm > (1.0 + HIDDEN) * surface {
            return None;
        }
        let (column, row) = ((u as usize).min(width.saturating_sub(2)), (v as usize).min(height.saturating_sub(2)));
        let (x, y) = (u - column as f32, v - row as f32);
        let pixel_at = |c: usize, r: usize| image.data[(row + r).min(height - 1) * width + (column + c).min(width - 1)];
        let (tl, tr, bl, br) = (pixel_at(0, 0), pixel_at(1, 0), pixel_at(0, 1), pixel_at(1, 1));
        Some(std::array::from_fn(|i| {
            let top = f32::from(tl[i]) * (1.0 - x) + f32::from(tr[i]) * x;
            let bottom = f32::from(bl[i]) * (1.0 - x) + f32::from(br[i]) * x;
            (top * (1.0 - y) + bottom * y).round() as u8
        }))
    };
    seen(points, camera, camera_from_depth).iter().map(|s| s.as_ref().and_then(colour)).collect()
}
