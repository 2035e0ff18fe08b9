//! The images in which tags are read.

use depthcal_io::GrayImage;

use crate::stretch::{Plane, Stretch};

/// The images in which tags are read, with their enlargement, the cheapest first: the stretched image at its own size,
/// then at twice its size.
pub(super) fn attempts(image: &GrayImage) -> impl Iterator<Item = (Plane, usize)> {
    let stretches = Stretch::candidates(image);
    [1, 2]
        .into_iter()
        .flat_map(move |scale| stretches.iter().map(move |&s| (Plane::stretched(image, s), scale)))
        .filter(|(plane, scale)| *scale == 1 || plane.is_small())
}
