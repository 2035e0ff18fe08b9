//! The search for a chessboard.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;

use super::attempt::attempts;
use super::order::in_order;
use crate::detection::{DetectOptions, Detection, Polarity};
use crate::error::DetectError;
use crate::refine::clear::{keep_clear, take_over};
use crate::refine::{RefineOptions, homography_mapping, refine_corners};
use crate::stretch::{Plane, Stretch};

/// After a fit, a corner farther from the smooth map than this many times the rms distance is fitted again from the
/// map's position.
const STRAY: f64 = 2.5;

/// Searches an image for a chessboard.
pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    let planes: Vec<Plane> = Stretch::candidates(image).iter().map(|&s| Plane::stretched(image, s)).collect();
    for attempt in attempts(options.detector) {
        for plane in &planes {
            let Some(markers) = attempt.corners(plane, target)?.and_then(|c| in_order(&c, target, plane)) else {
                continue;
            };
            let mut detection = Detection { markers, polarity: Polarity::DarkOnBright, charuco_layout: None };
            if options.refine {
                sharpen(image, &mut detection, target)?;
            }
            return Ok(Some(detection));
        }
    }
    Ok(None)
}

/// Replaces the found corners by fitted crossings. A crossing that ends far from where its neighbours predict it had a
/// bad start and is fitted again from the predicted position.
fn sharpen(image: &GrayImage, detection: &mut Detection, target: &Target) -> Result<(), DetectError> {
    let options = RefineOptions::default();
    for _ in 0..2 {
        let refined = refine_corners(image, detection, target, &options)?;
        take_over(detection, &refined);
        let Some(map) = homography_mapping(detection, target) else { break };
        let limit = STRAY * map.rms_px();
        let mut strays = detection.clone();
        strays.markers.retain_mut(|marker| {
            let Some(place) = map.apply(target.point(marker.index)) else { return false };
            let distance = (place[0] - marker.pixel[0]).hypot(place[1] - marker.pixel[1]);
            marker.pixel = place;
            distance > limit
        });
        if strays.markers.is_empty() {
            break;
        }
        for stray in strays.markers {
            detection.markers[stray.index].pixel = stray.pixel;
        }
    }
    let refined = refine_corners(image, detection, target, &options)?;
    keep_clear(detection, &refined);
    Ok(())
}
