//! Where a capture has depth samples.

use depthcal_model::field::Domain;

use crate::observe::{CameraFrames, SampledFrame};

/// The image and the depths that were seen, but for the outermost half per cent.
pub(super) fn seen(capture: &CameraFrames<SampledFrame>) -> Domain {
    let mut depths: Vec<f64> = capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| s.depth_mm)).collect();
    depths.sort_by(f64::total_cmp);
    let cut = depths.len() / 200;
    let range = [depths[cut], depths[depths.len() - 1 - cut]];
    Domain {
        size_px: [capture.width as f64, capture.height as f64],
        depth_mm: (range[1] > 1.01 * range[0]).then_some(range),
    }
}
