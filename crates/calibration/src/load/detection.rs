//! Boards in images, and circle centres refined with the camera that they give.

use std::path::Path;

use depthcal_detect::{
    CircleDiameter, DetectOptions, Detection, FrameError, Marker, RefineOptions, measure_circle_diameter,
};
use depthcal_model::{Camera, CharucoLayout, Register, Target};
use depthcal_statistics::upper_median;
use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;
use tracing::info;

use super::circle_diameter::MeasuredDiameter;
use super::error::LoadError;
use super::found::Found;
use crate::calibrate::{CalibratedCamera, CameraOptions, calibrate_image};
use crate::cause::{TRIED, board_cause, board_cause_of_few_markers};
use crate::observe::{CameraFrames, DetectedFrame, MarkerObservation, PosedFrame, RawFrame};
use crate::progress::ProgressHandle;
use crate::start::{FEWEST_FRAMES, FrameMarkers, is_wide};

/// Rounds of calibration and refinement; the second moves centres by less than a hundredth of a pixel.
const ROUNDS: usize = 2;
/// Number of frames in which the diameter of dots is measured, at most.
const MEASURED_FRAMES: usize = 24;
/// Smallest standard deviation of a marker, px: the fit of one dot's grey values does not see errors of print and rounding.
const FLOOR_PX: f64 = 0.02;

/// The markers of the declared board in the frames of the dataset in the folder `root`.
///
/// # Errors
///
/// [`LoadError::OtherBoard`] where the images show another board than the declared one; [`LoadError`] of the images.
pub(super) fn find_board(
    root: &Path,
    target: &Target,
    frames: &[RawFrame],
    register: &Register,
    progress: &ProgressHandle,
) -> Result<Found, LoadError> {
    let mut board = find_markers(target, frames, register, progress)?;
    let with_board = board.markers.iter().filter(|markers| !markers.is_empty()).count();
    let cause = if with_board < FEWEST_FRAMES.min(frames.len()) {
        let _stage = progress.stage("looking for other boards");
        board.tried = Some(TRIED);
        board_cause(target, frames.iter())
    } else {
        board_cause_of_few_markers(target, frames, &board.markers)
    };
    match cause {
        Some(cause) => Err(LoadError::OtherBoard { root: root.to_owned(), cause: Box::new(cause) }),
        None => Ok(board),
    }
}

/// Markers of every frame, in order; none where the board was not found. The diameter of dots is measured. Dots are refined as in
/// Datta, Kim, Kanade 2009: calibrate, rectify with the camera, match, map back, again. Where the frames do not determine a
/// camera (all boards parallel, too few frames), the rectification of each frame's own homography stays.
fn find_markers(
    target: &Target,
    frames: &[RawFrame],
    register: &Register,
    progress: &ProgressHandle,
) -> Result<Found, LoadError> {
    let mut detections = detect(target, frames, progress)?;
    if target.circle_diameter_mm().is_some() && detections.iter().all(Option::is_none) {
        // The declared diameter may be far from the truth, for instance be the radius.
        detections = detect(&target.with_circle_diameter_mm(0.0), frames, progress)?;
    }
    let charuco_layout = one_layout(target, frames, &mut detections)?;
    let mut markers: Vec<Vec<MarkerObservation>> =
        detections.iter().map(|d| d.as_ref().map(plain_markers).unwrap_or_default()).collect();
    if !target.has_circles() {
        return Ok(Found { markers, charuco_layout, ..Found::default() });
    }
    let circle_diameter = measure(target, frames, &detections)?;
    let diameter_mm = match circle_diameter {
        Some(measured) if measured.declared_mm.is_none() || measured.contradicts_declaration() => {
            Some(measured.diameter_mm)
        }
        _ => target.circle_diameter_mm(),
    };
    if let Some(diameter_mm) = diameter_mm {
        let target = target.with_circle_diameter_mm(diameter_mm);
        for round in 0..ROUNDS {
            if !refine(&target, frames, &detections, &mut markers, register)? {
                info!("the frames give no camera: circle centres keep the rectification of their own frame");
                break;
            }
            info!("circle centres refined, round {}", round + 1);
        }
    }
    Ok(Found { markers, circle_diameter, charuco_layout, tried: None })
}

/// The layout of a ChArUco board, that of most frames. Frames in which another was seen, or no board, are searched again for this
/// one: few tags can look like either.
fn one_layout(
    target: &Target,
    frames: &[RawFrame],
    detections: &mut [Option<Detection>],
) -> Result<Option<CharucoLayout>, LoadError> {
    let frames_with = |detections: &[Option<Detection>], layout| {
        detections.iter().flatten().filter(|d| d.charuco_layout == Some(layout)).count()
    };
    let [current, legacy] =
        [CharucoLayout::Current, CharucoLayout::Legacy].map(|layout| frames_with(detections, layout));
    if current + legacy == 0 {
        return Ok(None);
    }
    let layout = if legacy > current { CharucoLayout::Legacy } else { CharucoLayout::Current };
    let options = DetectOptions { charuco_layout: Some(layout), ..DetectOptions::default() };
    frames.par_iter().zip(detections).with_max_len(1).try_for_each(|(frame, detection)| {
        let is_settled = detection.as_ref().is_some_and(|d| d.charuco_layout.is_none_or(|seen| seen == layout));
        if let (false, Some(image)) = (is_settled, &frame.image) {
            info!("{}: searched again for the layout of a ChArUco board that most frames have", frame.name);
            *detection = depthcal_detect::detect(&*image.get()?, target, &options)?;
        }
        Ok::<(), LoadError>(())
    })?;
    Ok(Some(layout))
}

/// The board in every frame, in order.
fn detect(
    target: &Target,
    frames: &[RawFrame],
    progress: &ProgressHandle,
) -> Result<Vec<Option<Detection>>, LoadError> {
    let job = progress.steps("looking for boards", frames.len());
    // Frames without an image have no board.
    let with_image: Vec<Option<usize>> = {
        let mut next = 0..;
        frames.iter().map(|f| f.image.as_ref().and_then(|_| next.next())).collect()
    };
    let loaders: Vec<(String, _)> = frames
        .iter()
        .filter_map(|frame| {
            let image = frame.image.clone()?;
            Some((frame.name.clone(), move || image.get().map(|image| (*image).clone())))
        })
        .collect();
    let results = depthcal_detect::detect_all(&loaders, target, &DetectOptions::default(), &|_, _| job.advance());
    let mut detections = Vec::with_capacity(results.len());
    for result in results {
        detections.push(match result {
            Ok(detection) => detection,
            Err(FrameError::Detect { source, .. }) => return Err(source.into()),
            Err(FrameError::Load { source, .. }) => return Err(source.into()),
            // The error may grow variants; a frame for which there is no answer has no board.
            Err(_) => None,
        });
    }
    Ok(with_image.into_iter().map(|i| i.and_then(|i| detections[i].take())).collect())
}

/// The diameter of the dots, from frames spread over the capture; `None` where it cannot be measured in any.
fn measure(
    target: &Target,
    frames: &[RawFrame],
    detections: &[Option<Detection>],
) -> Result<Option<MeasuredDiameter>, LoadError> {
    let with_board: Vec<_> =
        frames.iter().zip(detections).filter_map(|(f, d)| Some((f.image.as_ref()?, d.as_ref()?))).collect();
    let every = with_board.len().div_ceil(MEASURED_FRAMES).max(1);
    let chosen: Vec<_> = with_board.into_iter().step_by(every).collect();
    let measured: Vec<Option<CircleDiameter>> = chosen
        .into_par_iter()
        .map(|(image, detection)| Ok(measure_circle_diameter(&*image.get()?, detection, target)?))
        .collect::<Result<_, LoadError>>()?;
    let frames: Vec<(f64, f64)> = measured.into_iter().flatten().map(|m| (m.diameter_mm, m.std_mm)).collect();
    Ok(MeasuredDiameter::from_frames(&frames, target.circle_diameter_mm()))
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
    let Some(first) = frames.iter().find_map(|f| f.image.as_ref()) else { return Ok(false) };
    let (width, height) = first.get().map(|i| (i.width, i.height))?;
    let capture = CameraFrames {
        name: String::new(),
        target: target.clone(),
        width,
        height,
        depth_unit_mm: None,
        disparity: None,
        technology: None,
        frames: frames
            .iter()
            .zip(markers.iter())
            .filter(|(_, m)| !m.is_empty())
            .map(|(f, m)| DetectedFrame {
                raw: RawFrame { name: f.name.clone(), ..RawFrame::default() },
                markers: m.clone(),
                ..DetectedFrame::default()
            })
            .collect(),
        dropped: Vec::new(),
    };
    let Some(calibrated) = any_lens(&capture, register) else { return Ok(false) };
    let pose_of = |name: &str| {
        let frame = calibrated.capture.frames.iter().find(|f| f.name == name)?;
        Some(frame.camera_from_board)
    };
    let refined: Vec<Result<Option<Vec<MarkerObservation>>, LoadError>> = frames
        .par_iter()
        .zip(detections)
        .zip(&*markers)
        .map(|((frame, detection), markers)| {
            let (Some(image), Some(detection), Some(pose)) =
                (frame.image.as_ref(), detection.as_ref(), pose_of(&frame.name))
            else {
                return Ok(None);
            };
            let image = &*image.get()?;
            let current = Detection {
                markers: markers.iter().map(|m| Marker { index: m.index, pixel: m.pixel }).collect(),
                ..detection.clone()
            };
            let mapping = |p: [f64; 2]| to_pixel(&calibrated.camera, &pose, p);
            let options = RefineOptions::default();
            let refined = depthcal_detect::refine_circles(image, &current, target, &mapping, &options)?;
            let observe = |m: &depthcal_detect::RefinedMarker| MarkerObservation {
                index: m.index,
                pixel: m.pixel,
                std_px: m.std_px.hypot(FLOOR_PX),
            };
            Ok(Some(refined.iter().map(observe).collect()))
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

/// The camera under which dots are fitted again: with the default lens; of wide images with that of two lenses for such that
/// keeps more frames or leaves less.
fn any_lens(capture: &CameraFrames, register: &Register) -> Option<CalibratedCamera<PosedFrame>> {
    let with_lens = |lens: &str| {
        let options = CameraOptions { register: register.clone(), lens: lens.to_owned(), ..CameraOptions::default() };
        calibrate_image(capture, &options).ok()
    };
    let markers: Vec<FrameMarkers<'_>> =
        capture.frames.iter().map(|f| FrameMarkers { name: &f.name, markers: &f.markers }).collect();
    if !is_wide(&capture.target, capture.width, capture.height, &markers, register) {
        return with_lens(&CameraOptions::default().lens);
    }
    ["kannala-brandt", "opencv8"].into_iter().filter_map(with_lens).min_by(|a, b| {
        let by_frames = b.capture.frames.len().cmp(&a.capture.frames.len());
        by_frames.then(a.reprojection_rms_px.total_cmp(&b.reprojection_rms_px))
    })
}

fn to_pixel(camera: &Camera, camera_from_board: &Isometry3<f64>, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    camera.project(&(camera_from_board * Point3::new(x, y, 0.0)).coords)
}
