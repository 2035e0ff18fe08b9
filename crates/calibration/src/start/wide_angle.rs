//! Start values of wide cameras, whose straight lines are too bent for homographies of the image.
//!
//! A first camera is the one of two that explains the markers better: the pinhole of Zhang's closed form, or the equidistant
//! projection with its focal length found by search. The lens that was asked for is then fitted to that camera's rays.

use depthcal_model::{Block, Camera, Register, RegisterError, Target};
use depthcal_statistics::upper_median;
use nalgebra::Vector3;

use super::frame_markers::FrameMarkers;
use super::lens_models::KANNALA_BRANDT;
use super::pose::estimate_pose;

/// Frames with the widest markers that are looked at.
const FRAMES: usize = 6;
/// Focal lengths that are tried, in image widths: from a fisheye whose image circle fills a third of the image to a telephoto
/// lens.
const FOCAL_LENGTHS: [f64; 2] = [0.12, 2.5];
/// Focal lengths that are tried where a pinhole is known, as multiples of its own.
const AROUND: [f64; 2] = [0.6, 1.7];
/// Ratio of neighbouring focal lengths in the first search, and rounds that refine the best.
const RATIO: f64 = 1.25;
const REFINEMENTS: usize = 3;
/// Depth of the points at which lenses are compared, mm; the lens does not depend on it.
const DEPTH_MM: f64 = 1000.0;

/// Reprojection error (px, median over frames of the root mean square) of the widest frames under a camera, their poses fitted;
/// infinite where more than half of them have none.
pub(super) fn error_px(camera: &Camera, target: &Target, frames: &[FrameMarkers<'_>]) -> f64 {
    let error = |f: &FrameMarkers<'_>| estimate_pose(camera, target, f).map_or(f64::INFINITY, |fit| fit.rms_px);
    let mut errors: Vec<f64> = frames.iter().map(error).collect();
    upper_median(&mut errors).unwrap_or(f64::INFINITY)
}

/// The frames whose markers reach farthest from the image's middle: they say most about the lens.
pub(super) fn widest<'a>(frames: &[FrameMarkers<'a>], width: usize, height: usize) -> Vec<FrameMarkers<'a>> {
    let middle = [0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)];
    let reach = |f: &FrameMarkers<'_>| {
        f.markers.iter().map(|m| (m.pixel[0] - middle[0]).hypot(m.pixel[1] - middle[1])).fold(0.0, f64::max)
    };
    let mut sorted: Vec<FrameMarkers<'a>> = frames.to_vec();
    sorted.sort_by(|a, b| reach(b).total_cmp(&reach(a)));
    sorted.truncate(FRAMES);
    sorted
}

/// The equidistant camera with its principal point in the image's middle that explains the frames best, and its error, px. Its
/// focal length is looked for around that of a pinhole, where there is one.
///
/// # Errors
///
/// [`RegisterError`] where the register has no piece `kannala_brandt`.
pub(super) fn equidistant(
    target: &Target,
    pinhole: Option<&Camera>,
    [width, height]: [usize; 2],
    frames: &[FrameMarkers<'_>],
    register: &Register,
) -> Result<(Camera, f64), RegisterError> {
    let lens = register.block(KANNALA_BRANDT, None)?;
    let middle = [0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)];
    let camera = |f: f64| Camera::new(width, height, [f, f, middle[0], middle[1], 0.0], vec![lens.clone()]);
    let tried = |f: f64| (f, error_px(&camera(f), target, frames));
    let [low, high] = match pinhole.map(Camera::pinhole) {
        Some([fx, ..]) => AROUND.map(|f| f * fx),
        None => FOCAL_LENGTHS.map(|f| f * width as f64),
    };
    let focal_lengths = std::iter::successors(Some(low), |f| Some(f * RATIO)).take_while(|f| *f <= high);
    let better = |a: (f64, f64), b: (f64, f64)| if b.1 < a.1 { b } else { a };
    let mut best = focal_lengths.map(tried).fold((low, f64::INFINITY), better);
    let mut ratio = RATIO;
    for _ in 0..REFINEMENTS {
        ratio = ratio.sqrt();
        best = better(better(best, tried(best.0 / ratio)), tried(best.0 * ratio));
    }
    Ok((camera(best.0), best.1))
}

/// The camera with this lens whose rays have nearly the pixels of another camera's, as far out as the markers reach.
pub(super) fn imitating(lens: Block, camera: &Camera, frames: &[FrameMarkers<'_>]) -> Camera {
    const RADII: usize = 24;
    const DIRECTIONS: usize = 16;
    let reach = frames.iter().flat_map(|f| f.markers).filter_map(|m| camera.ray(m.pixel, 1.0 / DEPTH_MM).ok());
    let widest = reach.map(|[x, y]| x.hypot(y)).fold(0.0, f64::max).atan();
    let rays = (1..=RADII).flat_map(|i| {
        let radius = (widest * i as f64 / RADII as f64).tan();
        (0..DIRECTIONS).map(move |k| {
            let (s, c) = (std::f64::consts::TAU * k as f64 / DIRECTIONS as f64).sin_cos();
            [radius * c, radius * s]
        })
    });
    let seen = |[x, y]: [f64; 2]| {
        let pixel = camera.project(&(Vector3::new(x, y, 1.0) * DEPTH_MM))?;
        Some(([x, y], pixel))
    };
    let (rays, pixels): (Vec<_>, Vec<_>) = rays.filter_map(seen).unzip();
    Camera::new(camera.width, camera.height, camera.pinhole(), vec![lens]).fitted_to_rays(&rays, &pixels)
}
