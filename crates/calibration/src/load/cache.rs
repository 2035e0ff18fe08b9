//! Detections that are kept from run to run, by the content of the dataset.
//!
//! A cached detection is `observations.json` of all frames, those without a board too, with a checksum among its settings. A file
//! that is cut, changed, of another version or of another dataset is not used; the next detection replaces it.

use std::path::Path;

use depthcal_io::{DatasetCamera, FrameMetadata, FrameObservations, Observations, digest_json};
use depthcal_model::CharucoLayout;
use tracing::{info, warn};

use super::circle_diameter::MeasuredDiameter;
use super::found::Found;
use crate::observe::{DroppedFrame, MarkerObservation};

/// Version of detection and refinement: cached detections of another are not used.
pub(super) const DETECTION_VERSION: &str = "3";
/// The setting that holds it.
pub(super) const DETECTION: &str = "detection";
/// The setting that holds the layout of a ChArUco board.
pub(super) const LAYOUT: &str = "charuco_layout";
/// The setting that holds the digest of everything else in the file.
const CHECKSUM: &str = "checksum";

/// Reads the cached detections of a dataset; `None` where the cache is damaged, or of another version, dataset or board.
pub(super) fn read(path: &Path, digest: &str, dataset: &DatasetCamera) -> Option<Found> {
    if !path.exists() {
        return None;
    }
    let mut cached = match Observations::read(path) {
        Ok(cached) => cached,
        Err(error) => {
            info!("the cached detections are not used, and are replaced: {error}");
            return None;
        }
    };
    let checksum = cached.settings.remove(CHECKSUM);
    if checksum.is_none() || checksum != digest_json(&cached) {
        info!("{}: the cached detections were changed; they are not used, and are replaced", path.display());
        return None;
    }
    let declared_mm = dataset.target.circle_diameter_mm();
    let circle_diameter = MeasuredDiameter::from_settings(&cached.settings, declared_mm);
    let target = match (declared_mm, circle_diameter) {
        (None, Some(measured)) => dataset.target.with_circle_diameter_mm(measured.diameter_mm),
        _ => dataset.target.clone(),
    };
    let version = cached.settings.get(DETECTION).is_some_and(|version| version == DETECTION_VERSION);
    if !version || cached.dataset.digest != digest || cached.target != target {
        return None;
    }
    let parts = target.parts();
    let frame_markers = |name: &str| -> Option<Vec<MarkerObservation>> {
        let frames = parts.iter().map(|part| cached.frame(&part.frame_name(name)));
        let frames = frames.collect::<Option<Vec<_>>>()?;
        Some(frames.into_iter().flat_map(|frame| frame.markers.clone()).collect())
    };
    let markers = dataset.frames.iter().map(|f| frame_markers(&f.name)).collect::<Option<_>>()?;
    let charuco_layout = cached.settings.get(LAYOUT).and_then(|name| CharucoLayout::named(name));
    Some(Found { markers, circle_diameter, charuco_layout, tried: None })
}

/// Keeps the detections; without them in the cache, the next run is slower and its results are the same.
pub(super) fn write(
    path: &Path,
    mut observations: Observations,
    without_board: &[DroppedFrame],
    [width, height]: [usize; 2],
) {
    // Frames without a board are part of the answer.
    observations.frames.extend(without_board.iter().map(|d| FrameObservations {
        name: d.name.clone(),
        width,
        height,
        markers: Vec::new(),
        depth: Vec::new(),
        metadata: FrameMetadata::default(),
    }));
    observations.settings.extend(digest_json(&observations).map(|digest| (CHECKSUM.to_owned(), digest)));
    if let Err(error) = observations.write(path) {
        warn!("the detections are not cached, so the next run detects again: {error}; DEPTHCAL_CACHE sets the folder");
    }
}
