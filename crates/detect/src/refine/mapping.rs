//! The mapping from board to image before a camera is known.

use depthcal_model::target::Target;

use crate::detection::Detection;
use crate::geometry::BoardMap;

/// A mapping from the board (mm) to the image (px), for [`refine_circles`](crate::refine_circles) while no camera is
/// known: a homography with a smooth correction for the lens. `None` when the markers do not determine it.
pub fn homography_mapping(detection: &Detection, target: &Target) -> Option<BoardMap> {
    let pairs: Vec<_> =
        detection.markers.iter().filter(|m| m.index < target.len()).map(|m| (target.point(m.index), m.pixel)).collect();
    BoardMap::fit(&pairs)
}
