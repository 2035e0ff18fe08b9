//! Boards in images, and circle centres refined with the camera that they give.

use depthcal_detect::{DetectError, DetectOptions, Detection, FrameError, Marker, RefineOptions};
use depthcal_model::{Camera, Register, Target};
use depthcal_statistics::upper_median;
use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;
use tracing::info;

use super::error::LoadError;
use crate::calibrate::{CalibrateOptions, calibrate_image};
use crate::observe::{Capture, DetectedFrame, MarkerObservation, RawFrame};
use crate::progress::ProgressHandle;

/// Rounds of calibration and refinement; the second moves centres by less than a hundredth of a pixel.
const ROUNDS: usize = 2;
/// What no fit of one dot's grey values knows (uneven print, rounding), px: no marker counts as better than this.
const FLOOR_PX: f64 = 0.02;

/// Markers of every frame, in order; none where the board was not found. Dots are refined as in Datta, Kim, Kanade 2009:
/// calibrate, rectify with the camera, match, map back, again. Where the frames do not determine a camera (all boards
/// parallel, too few frames), the rectification of each frame's own homography stays.
pub(crate) fn find_markers(
    target: &Target,
    frames: &[RawFrame],
    register: &Register,
    progress: &ProgressHandle,
) -> Result<Vec<Vec<MarkerObservation>>, LoadError> {
    let job = progress.steps("looking for boards", frames.len());
    let loaders: Vec<(String, _)> = frames
        .iter()
        .map(|frame| {
            let image = frame.image.clone();
            let load = move || image.as_deref().cloned().ok_or(std::fmt::Error);
            (frame.name.clone(), load)
        })
        .collect();
    let found = depthcal_detect::detect_all(&loaders, target, &DetectOptions::default(), &|_, _| job.advance());
    let mut detections = Vec::with_capacity(found.len());
    for result in found {
        detections.push(match result {
            Ok(detection) => detection,
            Err(FrameError::Detect { source, .. }) => return Err(source.into()),
            // Every frame that gets here has its image in memory.
            Err(_) => None,
        });
    }
    drop(job);
    let mut markers: Vec<Vec<MarkerObservation>> =
        detections.iter().map(|d| d.as_ref().map(plain_markers).unwrap_or_default()).collect();
    if target.circle_diameter_mm().is_some() {
        for round in 0..ROUNDS {
            if !refine(target, frames, &detections, &mut markers, register)? {
                info!("the frames give no camera: circle centres keep the rectification of their own frame");
                break;
            }
            info!("circle centres refined, round {}", round + 1);
        }
    }
    Ok(markers)
}

fn plain_markers(detection: &Detection) -> Vec<MarkerObservation> {
    detection.markers.iter().map(|m| MarkerObservation { index: m.index, pixel: m.pixel, std_px: 1.0 }).collect()
}

/// One round; `false` where the frames do not give a camera.
fn refine(
    target: &Target,
    frames: &[RawFrame],
    detections: &[Option<Detection>],
    markers: &mut [Vec<MarkerObservation>],
    register: &Register,
) -> Result<bool, LoadError> {
    let (width, height) = frames.iter().find_map(|f| f.image.as_ref().map(|i| (i.width, i.height))).unwrap_or_default();
    let capture = Capture {
        name: String::new(),
        target: target.clone(),
        width,
        height,
        depth_unit_mm: None,
        frames: frames
            .iter()
            .zip(markers.iter())
            .filter(|(_, m)| !m.is_empty())
            .map(|(f, m)| DetectedFrame {
                raw: RawFrame { name: f.name.clone(), ..RawFrame::default() },
                markers: m.clone(),
            })
            .collect(),
        dropped: Vec::new(),
    };
    let options = CalibrateOptions { register: register.clone(), ..CalibrateOptions::default() };
    let Ok(calibrated) = calibrate_image(&capture, &options) else { return Ok(false) };
    let pose_of = |name: &str| {
        let frame = calibrated.capture.frames.iter().find(|f| f.name == name)?;
        Some(frame.camera_from_board)
    };
    let refined: Vec<Result<Option<Vec<MarkerObservation>>, DetectError>> = frames
        .par_iter()
        .zip(detections)
        .zip(&*markers)
        .map(|((frame, detection), markers)| {
            let (Some(image), Some(detection), Some(pose)) =
                (frame.image.as_deref(), detection.as_ref(), pose_of(&frame.name))
            else {
                return Ok(None);
            };
            let current = Detection {
                markers: markers.iter().map(|m| Marker { index: m.index, pixel: m.pixel }).collect(),
                polarity: detection.polarity,
            };
            let mapping = |p: [f64; 2]| to_pixel(&calibrated.camera, &pose, p);
            let options = RefineOptions::default();
            depthcal_detect::refine_circles(image, &current, target, &mapping, &options).map(|refined| {
                let observe = |m: &depthcal_detect::RefinedMarker| MarkerObservation {
                    index: m.index,
                    pixel: m.pixel,
                    std_px: m.std_px.hypot(FLOOR_PX),
                };
                Some(refined.iter().map(observe).collect())
            })
        })
        .collect();
    for (markers, refined) in markers.iter_mut().zip(refined) {
        if let Some(refined) = refined? {
            *markers = refined;
        }
    }
    // Relative to the median marker, so that the noise of a typical marker is the adjustment's pixel sigma.
    let mut stds: Vec<f64> = markers.iter().flatten().map(|m| m.std_px).collect();
    if let Some(median) = upper_median(&mut stds).filter(|m| *m > 0.0) {
        markers.iter_mut().flatten().for_each(|m| m.std_px /= median);
    }
    Ok(true)
}

fn to_pixel(camera: &Camera, camera_from_board: &Isometry3<f64>, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    camera.project(&(camera_from_board * Point3::new(x, y, 0.0)).coords)
}
