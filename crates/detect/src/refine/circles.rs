//! Refinement of circle grids.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use rayon::prelude::*;

use super::clear::{keep_clear, take_over};
use super::disc::{Disc, fit_disc};
use super::mapping::homography_mapping;
use super::marker::{RefineOptions, RefinedMarker, standard_deviation};
use super::pixels::Pixels;
use crate::board::{kind, step_mm};
use crate::check::{check_image, check_markers};
use crate::detection::Detection;
use crate::error::DetectError;
use crate::geometry::LocalMap;

/// Fits the centres of a circle grid's dots under the current mapping from the board (mm) to the image (px). It
/// alternates with calibration: calibrate, refine, calibrate again (Datta, Kim, Kanade 2009).
///
/// The image is not rectified. Every pixel around a dot is mapped to the board, where an ideal disc with the image's
/// blur is fitted: its centre, radius, contrast, illumination and blur. Grey values are thus used as measured, and the
/// bias of circle centres under perspective and lens distortion vanishes as far as the mapping's curvature within a dot
/// is right.
///
/// `pixel_from_board` may return `None` where it is undefined. Dots that cannot be fitted (hidden, cut off by the image
/// border, without contrast) are left out.
///
/// # Errors
/// [`DetectError`] when the board has no dots or dots of unknown diameter, a marker is not on the board, or the image is
/// inconsistent.
pub fn refine_circles(
    image: &GrayImage,
    detection: &Detection,
    target: &Target,
    pixel_from_board: &(dyn Fn([f64; 2]) -> Option<[f64; 2]> + Sync),
    options: &RefineOptions,
) -> Result<Vec<RefinedMarker>, DetectError> {
    check_image(image)?;
    check_markers(detection, target)?;
    if !target.has_circles() {
        return Err(DetectError::WrongKind { kind: kind(target), markers: "circles" });
    }
    let diameter = target.circle_diameter_mm().ok_or(DetectError::Field {
        field: "board.circle_diameter_mm",
        value: 0.0,
        remedy: "the diameter of the dots is not known; measure it first with measure_circle_diameter",
    })?;
    let pixels = Pixels::new(image);
    let radius = diameter / 2.0;
    let gap = (step_mm(target) - diameter).max(0.0);
    let refined = detection
        .markers
        .par_iter()
        .map(|marker| {
            let center = target.point(marker.index);
            // A mapping without the lens may be off by some pixels: shift it to where the dot was found.
            let nominal = pixel_from_board(center)?;
            let shift = [marker.pixel[0] - nominal[0], marker.pixel[1] - nominal[1]];
            let seen = |p: [f64; 2]| pixel_from_board(p).map(|q| [q[0] + shift[0], q[1] + shift[1]]);
            let map = LocalMap::new(&seen, center, radius + 0.6 * gap)?;
            let disc = Disc { center, radius, gap, radius_sigma: options.radius_sigma };
            let fitted = fit_disc(&pixels, &map, &disc, options.iterations)?;
            let pixel = seen(fitted.center)?;
            let (_, to_board) = map.apply(pixel);
            let to_pixel = to_board.try_inverse()?;
            Some(RefinedMarker {
                index: marker.index,
                pixel,
                std_px: standard_deviation(&(to_pixel * fitted.covariance * to_pixel.transpose())),
                relative_noise: fitted.relative_noise,
                blur_px: fitted.width_px,
                contrast: fitted.contrast.abs(),
                radius_ratio: fitted.radius / radius,
            })
        })
        .collect::<Vec<Option<RefinedMarker>>>();
    Ok(refined.into_iter().flatten().collect())
}

/// Replaces the centroids of a detection by fitted centres, under a mapping fitted to the markers themselves.
pub(crate) fn sharpen_circles(
    image: &GrayImage,
    detection: &mut Detection,
    target: &Target,
) -> Result<(), DetectError> {
    let options = RefineOptions::default();
    // The second round has a better mapping; a third would change nothing.
    for last in [false, true] {
        let Some(map) = homography_mapping(detection, target) else { break };
        let refined = refine_circles(image, detection, target, &|p| map.apply(p), &options)?;
        if last { keep_clear(detection, &refined) } else { take_over(detection, &refined) }
    }
    Ok(())
}
