//! Evaluation: errors of a camera on a capture, before and after correction, as the thesis defines them.
//!
//! Frames are scored with poses from the image alone, with K and lens of the camera held. "Before" is the depth as measured,
//! "after" the depth corrected by the camera's pixel and depth pieces. Pixels that are no measurements of the board are counted
//! and left out, see [`crate::observe::outliers`].

use std::borrow::Cow;

use depthcal_io::{BeforeAfter, DatasetEvaluation, FrameEvaluation, MeanStd, Outliers, Rms};
use depthcal_model::Camera;
use depthcal_statistics::{Thinning, rms, upper_median};
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use super::corrected_pixels::corrected;
use super::depth_errors::{DepthErrors, PixelError};
use crate::estimators::{MarkerPoint, marker_points};
use crate::observe::board_pixels::{BoardPixel, BoardPixels, board_area_px, board_pixels, key};
use crate::observe::board_plane::BoardSurface;
use crate::observe::board_region::BoardRegion;
use crate::observe::outliers::remove_outliers;
use crate::observe::pixel_covariates::PixelCovariates;
use crate::observe::wrong_markers::{limit_px, take_wrong};
use crate::observe::{
    AdjustableFrame, CameraFrames, DetectedFrame, DroppedFrame, EvaluableFrame, MarkerObservation, OpenFrame, PixelRays,
};
use crate::start::{FrameMarkers, PoseFit, StartError, estimate_pose, pose_doubt, refine_pose};

/// Most pixels of all frames together that are kept one by one, about.
const KEPT_PIXELS: usize = 200_000;
/// … but of a frame at least and at most so many.
const KEPT_OF_A_FRAME: [usize; 2] = [200, 4000];

/// Errors of one frame.
#[derive(Debug, Clone)]
pub struct EvaluatedFrame {
    /// Its name.
    pub name: String,
    /// Pose from the image alone: maps board coordinates to camera coordinates, mm.
    pub camera_from_board: Isometry3<f64>,
    /// Reprojection errors: detected pixel and detected minus projected, [u, v, du, dv], px; none without an image.
    pub reprojection: Vec<[f64; 4]>,
    /// Markers that were left out because they are far from where the board has them.
    pub wrong_markers: usize,
    /// Dot errors before and after correction, mm; one pair per marker with depth.
    pub dots: Vec<[f64; 2]>,
    /// Where its markers are by image and corrected depth: those that have depth around them.
    pub markers: Vec<CorrectedMarker>,
    /// Sums over all its board pixels.
    pub depth: DepthErrors,
    /// Some of its board pixels, scattered over all of them and at the same places whatever the camera; all where these are few.
    pub pixels: Vec<PixelError>,
    /// Board pixels that were left out because they are no measurements of the board.
    pub outliers: usize,
    /// Depth error from which on they are at the frame's distance, mm; `None` where the pixels are too few to tell.
    pub outlier_limit_mm: Option<f64>,
    /// Board pixels whose measured depth the camera cannot correct.
    pub uncorrectable: usize,
}

/// A marker as a point in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrectedMarker {
    /// Its number on the board.
    pub index: usize,
    /// Where it is by its pixel and the depth as measured, camera frame, mm.
    pub measured_mm: [f64; 3],
    /// Where it is by its pixel and the corrected depth, camera frame, mm.
    pub corrected_mm: [f64; 3],
}

/// Errors of a dataset.
#[derive(Debug, Clone)]
pub struct EvaluatedCamera {
    /// Its name.
    pub name: String,
    /// Its frames.
    pub frames: Vec<EvaluatedFrame>,
    /// Frames that were not evaluated, and why.
    pub dropped: Vec<DroppedFrame>,
}

/// Evaluates a camera on all frames of a capture.
pub fn evaluate_camera<F>(camera: &Camera, capture: &CameraFrames<F>) -> EvaluatedCamera
where
    F: EvaluableFrame,
{
    evaluate_part(camera, capture, &OnePart::of(Thinning::ALL, capture.frames.len()))
}

/// A camera that locates uncorrected depth: pixel pieces belong to the correction.
pub(crate) fn uncorrected(camera: &Camera) -> Camera {
    camera.filtered(|block| !crate::adjust::blocks::is_depth_only(block))
}

/// How one part of several is evaluated.
pub(crate) struct OnePart<'a> {
    /// Which board pixels count.
    pub thinning: Thinning,
    /// Number of frames of all parts.
    pub frames: usize,
    /// Rays of a camera that is nearly the one that is evaluated, without its depth pieces; for parts of few pixels.
    pub similar: Option<&'a PixelRays<'a>>,
}

impl OnePart<'_> {
    /// A part of so many frames, of whose camera no other rays are known.
    pub fn of(thinning: Thinning, frames: usize) -> Self {
        Self { thinning, frames, similar: None }
    }
}

/// Evaluates a camera on the frames of a part.
pub(crate) fn evaluate_part<F>(camera: &Camera, capture: &CameraFrames<F>, part: &OnePart<'_>) -> EvaluatedCamera
where
    F: EvaluableFrame,
{
    let OnePart { thinning, frames, similar } = *part;
    let bare = uncorrected(camera);
    let rays = match similar {
        Some(similar) => similar.of_similar(&bare, &capture.target),
        None => PixelRays::new(&bare, &capture.target),
    };
    let rays = rays.to_be_corrected_by(camera);
    let [least, most] = KEPT_OF_A_FRAME;
    let kept_pixels = (KEPT_PIXELS / frames.max(1)).clamp(least, most);
    let evaluation = Evaluation { camera, rays: &rays, capture, kept_pixels, thinning };
    let mut seen: Vec<(Cow<'_, DetectedFrame>, Result<PoseFit, StartError>)> = capture
        .frames
        .par_iter()
        .map(|frame| (Cow::Borrowed(frame.as_ref()), evaluation.pose(frame.as_ref(), frame.known_pose())))
        .collect();
    evaluation.leave_out_wrong_markers(&mut seen);
    // Errors of the markers are those of the median frame: few markers fit any pose.
    let mut rms_px: Vec<f64> = seen.iter().filter_map(|(_, pose)| Some(pose.as_ref().ok()?.rms_px)).collect();
    let sigma_px = upper_median(&mut rms_px).unwrap_or(0.0) / std::f64::consts::SQRT_2;
    let frame = |(frame, pose): (Cow<'_, DetectedFrame>, Result<PoseFit, StartError>)| {
        let frame = &*frame;
        let dropped = |reason: String| DroppedFrame { name: frame.name.clone(), reason };
        let pose = pose.map_err(|e| dropped(e.to_string()))?.camera_from_board;
        match pose_doubt(camera, &capture.target, &markers_of(frame), &pose, sigma_px) {
            Some(doubt) => Err(dropped(doubt.to_string())),
            None => {
                let open = frame.open().map_err(|e| dropped(e.to_string()))?;
                let evaluated = evaluation.of_frame(frame, &open, pose);
                let region = BoardRegion::within_markers(&capture.target, &frame.markers);
                let area_px = board_area_px(&bare, &region, &pose);
                // A part of the pixels was kept by the caller already: the share of all is unknown.
                let scarce = if thinning == Thinning::ALL { scarce_and_far(&evaluated, area_px) } else { None };
                scarce.map_or(Ok(evaluated), |reason| Err(dropped(reason)))
            }
        }
    };
    let frames: Vec<Result<EvaluatedFrame, DroppedFrame>> = seen.into_par_iter().map(frame).collect();
    let mut evaluated =
        EvaluatedCamera { name: capture.name.clone(), frames: Vec::new(), dropped: capture.dropped.clone() };
    for frame in frames {
        match frame {
            Ok(frame) => evaluated.frames.push(frame),
            Err(dropped) => evaluated.dropped.push(dropped),
        }
    }
    evaluated
}

/// Why a frame with hardly any depth on its board is not judged: that little is far from the board, and nothing else of the
/// frame tells it from measurements. `None` of other frames.
fn scarce_and_far(frame: &EvaluatedFrame, area_px: usize) -> Option<String> {
    /// Share of the board's pixels with depth below which a frame has hardly any.
    const SCARCE: f64 = 0.02;
    /// Share of the distance by which a depth camera is not off.
    const FAR: f64 = 0.08;
    let count = frame.pixels.len();
    if count == 0 || count as f64 > SCARCE * area_px as f64 {
        return None;
    }
    let error = upper_median(&mut frame.pixels.iter().map(|p| p.after_mm).collect::<Vec<_>>())?;
    let distance = upper_median(&mut frame.pixels.iter().map(|p| p.board_depth_mm).collect::<Vec<_>>())?;
    (error.abs() > FAR * distance).then(|| {
        format!(
            "hardly any depth: {count} of some {area_px} pixels of its board, and those are off by {:.0} mm",
            error.abs()
        )
    })
}

/// Data that all frames of an evaluation share.
struct Evaluation<'a, F> {
    camera: &'a Camera,
    /// Of the camera without pixel and depth pieces.
    rays: &'a PixelRays<'a>,
    capture: &'a CameraFrames<F>,
    kept_pixels: usize,
    /// Which board pixels count.
    thinning: Thinning,
}

impl<F: Sync> Evaluation<'_, F> {
    /// The pose from the image alone, searched from a known one where there is one.
    fn pose(&self, frame: &DetectedFrame, known: Option<&Isometry3<f64>>) -> Result<PoseFit, StartError> {
        let target = &self.capture.target;
        let refined = known.and_then(|pose| refine_pose(self.camera, target, &frame.markers, pose));
        refined.map_or_else(|| estimate_pose(self.camera, target, &markers_of(frame)), Ok)
    }

    /// Leaves out markers that were found in the wrong place, of frames that keep a pose without them, and estimates these poses
    /// anew.
    fn leave_out_wrong_markers(&self, seen: &mut [(Cow<'_, DetectedFrame>, Result<PoseFit, StartError>)]) {
        let distances = |(frame, pose): &(Cow<'_, DetectedFrame>, Result<PoseFit, StartError>)| {
            let Ok(pose) = pose else { return Vec::new() };
            let distance = |m: &MarkerObservation| {
                self.reprojection(m, &pose.camera_from_board).map_or(f64::INFINITY, |e| e[2].hypot(e[3]))
            };
            frame.markers.iter().map(distance).collect()
        };
        let distances: Vec<Vec<f64>> = seen.par_iter().map(distances).collect();
        let Some(limit) = limit_px(&distances.concat()) else { return };
        for ((frame, pose), distances) in seen.iter_mut().zip(&distances) {
            if distances.iter().all(|d| *d <= limit) {
                continue;
            }
            let mut cleaned = frame.as_ref().clone();
            cleaned.wrong_markers.extend(take_wrong(&mut cleaned.markers, distances, limit));
            let Ok(known) = pose.as_ref().map(|p| p.camera_from_board) else { continue };
            if let Ok(without) = self.pose(&cleaned, Some(&known)) {
                (*frame, *pose) = (Cow::Owned(cleaned), Ok(without));
            }
        }
    }

    /// Where a marker was found, and how far that is from its projection, [u, v, du, dv], px; `None` where it has none.
    fn reprojection(&self, marker: &MarkerObservation, pose: &Isometry3<f64>) -> Option<[f64; 4]> {
        let p = self.camera.board_point(self.capture.target.point(marker.index));
        let projected = self.camera.project(&(pose * nalgebra::Point3::from(p)).coords)?;
        let [u, v] = marker.pixel;
        Some([u, v, u - projected[0], v - projected[1]])
    }

    /// The frame's board pixels, seen from a pose, before and after correction.
    fn judged<'a>(
        &self,
        frame: &DetectedFrame,
        open: &'a OpenFrame<'a>,
        surface: &BoardSurface<'_>,
        pose: &Isometry3<f64>,
    ) -> Judged<'a> {
        let unit_mm = self.capture.depth_unit_mm.unwrap_or(1.0);
        let region = BoardRegion::within_markers(&self.capture.target, &frame.markers);
        let mut measured = board_pixels(open, unit_mm, self.rays, &region, pose, self.thinning);
        let (outliers, outlier_limit_mm) = remove_outliers(&mut measured.pixels);
        let corrected = corrected(self.camera, self.rays, &measured, surface);
        let BoardPixels { pixels: measured, covariates } = measured;
        Judged { measured, covariates, corrected, outliers, outlier_limit_mm }
    }

    fn of_frame(&self, frame: &DetectedFrame, open: &OpenFrame<'_>, pose: Isometry3<f64>) -> EvaluatedFrame {
        let target = &self.capture.target;
        let reprojection = frame.observed_markers().iter().filter_map(|m| self.reprojection(m, &pose)).collect();
        let surface = self.rays.surface(&pose);
        let judged = self.judged(frame, open, &surface, &pose);
        let Judged { measured: all, covariates, corrected, outliers, outlier_limit_mm } = judged;
        let points = |pixels: &[BoardPixel]| marker_points(frame, pixels, self.rays.camera(), target, &pose);
        let before = points(&all);
        let measured = all.len();
        let thinning = self.thinning.further(measured, self.kept_pixels);
        let mut depth = DepthErrors::default();
        let mut pixels = Vec::with_capacity(measured.min(self.kept_pixels + self.kept_pixels / 8));
        for (p, corrected) in all.iter().zip(&corrected) {
            let Some(c) = corrected else { continue };
            let error = PixelError::of(p, c, &surface);
            depth.add(&error);
            if thinning.keeps(key(p.pixel)) {
                let context = covariates.complete(p.number, p.pixel);
                pixels.push(PixelError { context, ..error });
            }
        }
        let correctable: Vec<BoardPixel> = corrected.into_iter().flatten().collect();
        let pairs: Vec<(usize, [MarkerPoint; 2])> = before
            .into_iter()
            .zip(points(&correctable))
            .zip(frame.observed_markers())
            .filter_map(|((before, after), marker)| Some((marker.index, [before?, after?])))
            .collect();
        let in_space = |p: &MarkerPoint| [p.ray[0], p.ray[1], 1.0].map(|x| x / p.inverse_depth);
        let markers = pairs.iter().map(|(index, [before, after])| CorrectedMarker {
            index: *index,
            measured_mm: in_space(before),
            corrected_mm: in_space(after),
        });
        EvaluatedFrame {
            name: frame.name.clone(),
            camera_from_board: pose,
            reprojection,
            wrong_markers: frame.wrong_markers.len(),
            dots: pairs.iter().map(|(_, pair)| [dot_distance(&pair[0]), dot_distance(&pair[1])]).collect(),
            markers: markers.collect(),
            depth,
            pixels,
            outliers,
            outlier_limit_mm,
            uncorrectable: measured - correctable.len(),
        }
    }
}

/// A frame's board pixels that are measurements of the board.
struct Judged<'a> {
    /// As measured.
    measured: Vec<BoardPixel>,
    covariates: PixelCovariates<'a>,
    /// Each of them after correction; `None` where the camera cannot correct it.
    corrected: Vec<Option<BoardPixel>>,
    outliers: usize,
    outlier_limit_mm: Option<f64>,
}

/// Results of `take` for the errors of all board pixels of each frame, at the adjusted poses of `capture` instead of those that
/// the images alone show. Frames whose images cannot be read have no pixels.
pub fn residual_pixels<F, T>(
    camera: &Camera,
    capture: &CameraFrames<F>,
    take: impl Fn(Vec<PixelError>) -> T + Sync,
) -> Vec<T>
where
    F: AdjustableFrame + EvaluableFrame,
    T: Send,
{
    let bare = uncorrected(camera);
    let rays = PixelRays::new(&bare, &capture.target).to_be_corrected_by(camera);
    let evaluation = Evaluation { camera, rays: &rays, capture, kept_pixels: 0, thinning: Thinning::ALL };
    let of_frame = |frame: &F| {
        let pose = &frame.posed().camera_from_board;
        let surface = rays.surface(pose);
        let errors = frame.posed().open().ok().map(|open| {
            let judged = evaluation.judged(frame.posed(), &open, &surface, pose);
            let pairs = judged.measured.iter().zip(&judged.corrected);
            let error = |(p, c): (&BoardPixel, &Option<BoardPixel>)| {
                let context = judged.covariates.context(p.number, p.pixel);
                Some(PixelError { context, ..PixelError::of(p, c.as_ref()?, &surface) })
            };
            pairs.filter_map(error).collect()
        });
        take(errors.unwrap_or_default())
    };
    capture.frames.par_iter().map(of_frame).collect()
}

fn markers_of(frame: &DetectedFrame) -> FrameMarkers<'_> {
    FrameMarkers { name: &frame.name, markers: &frame.markers }
}

/// Distance between a marker's position on the board and its position by image and depth, mm.
fn dot_distance(point: &MarkerPoint) -> f64 {
    let measured = Vector3::new(point.ray[0], point.ray[1], 1.0) / point.inverse_depth;
    (measured - point.point_in_camera).norm()
}

/// Mean and standard deviation as a record.
fn mean_std(values: impl Iterator<Item = f64> + Clone) -> MeanStd {
    let (mean, std) = depthcal_statistics::mean_std(values);
    MeanStd { mean, std }
}

impl EvaluatedCamera {
    /// Sums and counts, without the errors of single pixels.
    pub(crate) fn without_pixels(&self) -> Self {
        let frames = self.frames.iter().map(EvaluatedFrame::without_pixels).collect();
        Self { name: self.name.clone(), frames, dropped: self.dropped.clone() }
    }

    /// The errors over all frames alone.
    pub(crate) fn errors(&self) -> DatasetEvaluation {
        let dots = || self.frames.iter().flat_map(|f| f.dots.iter());
        let depth = DepthErrors::over(self.frames.iter().map(|f| &f.depth));
        DatasetEvaluation {
            name: self.name.clone(),
            frames: self.frames.len(),
            reprojection_px: reprojection(self.frames.iter().flat_map(|f| f.reprojection.iter())),
            dot_error_mm: (dots().count() > 0).then(|| dot_error(dots())),
            plane_error_mm: depth.plane_error_mm(),
            depth_rms_mm: depth.rms_mm(),
            outliers: self.outliers(),
            intervals: None,
            depth_90_percent_mm: None,
            whole_frames: None,
            frames_detail: Vec::new(),
        }
    }

    /// The pixels that were left out; `None` without depth on the board.
    pub fn outliers(&self) -> Option<Outliers> {
        outliers(self.frames.iter())
    }
}

/// The pixels of some frames that were left out; `None` without depth on the board.
pub fn outliers<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame> + Clone) -> Option<Outliers> {
    let mut limits: Vec<f64> = frames.clone().filter_map(|f| f.outlier_limit_mm).collect();
    let limit_mm = upper_median(&mut limits)?;
    let count: usize = frames.clone().map(|f| f.outliers).sum();
    let all: usize = frames.map(EvaluatedFrame::board_pixels).sum();
    Some(Outliers { count, share: count as f64 / all.max(1) as f64, limit_mm })
}

#[cfg(test)]
impl EvaluatedFrame {
    /// A frame of pixels at 1 m with these errors of depth, mm, before and after correction alike.
    pub(crate) fn of_depth_errors(name: String, errors_mm: &[f64]) -> Self {
        let pixel = |error_mm: &f64| PixelError {
            context: depthcal_model::Context::default(),
            board_depth_mm: 1000.0,
            board: [0.0; 2],
            cos_incidence: 1.0,
            before_mm: *error_mm,
            after_mm: *error_mm,
            height_before_mm: *error_mm,
            height_after_mm: *error_mm,
        };
        let pixels: Vec<PixelError> = errors_mm.iter().map(pixel).collect();
        Self {
            name,
            camera_from_board: Isometry3::identity(),
            reprojection: Vec::new(),
            wrong_markers: 0,
            dots: Vec::new(),
            markers: Vec::new(),
            depth: DepthErrors::of(&pixels),
            pixels,
            outliers: 0,
            outlier_limit_mm: None,
            uncorrectable: 0,
        }
    }
}

impl EvaluatedFrame {
    /// This frame without the errors of single pixels, which take nearly all of its memory.
    fn without_pixels(&self) -> Self {
        Self {
            name: self.name.clone(),
            camera_from_board: self.camera_from_board,
            reprojection: self.reprojection.clone(),
            wrong_markers: self.wrong_markers,
            dots: self.dots.clone(),
            markers: self.markers.clone(),
            depth: self.depth,
            pixels: Vec::new(),
            outliers: self.outliers,
            outlier_limit_mm: self.outlier_limit_mm,
            uncorrectable: self.uncorrectable,
        }
    }

    /// Number of its valid depth pixels on the board, whether they count or not.
    pub fn board_pixels(&self) -> usize {
        self.outliers + self.depth.pixels + self.uncorrectable
    }

    /// Share of its board pixels that were left out; 0 without any.
    pub fn outlier_share(&self) -> f64 {
        self.outliers as f64 / self.board_pixels().max(1) as f64
    }

    /// The record for `evaluation.json`.
    pub fn record(&self) -> FrameEvaluation {
        FrameEvaluation {
            name: self.name.clone(),
            markers: self.reprojection.len(),
            wrong_markers: self.wrong_markers,
            depth_pixels: self.depth.pixels,
            outliers: self.outliers,
            reprojection_px: reprojection(self.reprojection.iter()),
            dot_error_mm: (!self.dots.is_empty()).then(|| dot_error(self.dots.iter())),
            plane_error_mm: self.depth.plane_error_mm(),
            depth_rms_mm: self.depth.rms_mm(),
        }
    }
}

/// Root mean square of reprojection errors; `None` without any: the camera has no images.
pub(super) fn reprojection<'a>(errors: impl Iterator<Item = &'a [f64; 4]> + Clone) -> Option<Rms> {
    let is_any = errors.clone().next().is_some();
    is_any.then(|| Rms { rms: rms(errors.map(|e| e[2].hypot(e[3]))) })
}

/// Mean and standard deviation of distances between markers and their back-projections (thesis eq. 5.1–5.3).
fn dot_error<'a>(dots: impl Iterator<Item = &'a [f64; 2]> + Clone) -> BeforeAfter<MeanStd> {
    BeforeAfter { before: mean_std(dots.clone().map(|d| d[0])), after: mean_std(dots.map(|d| d[1])) }
}
