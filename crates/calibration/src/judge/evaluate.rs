//! Evaluation: errors of a camera on a capture, before and after correction, as the thesis defines them.
//!
//! Frames are scored with poses from the image alone, with K and lens of the camera held. "Before" is the depth as measured,
//! "after" the depth corrected by the camera's pixel and depth pieces.

use depthcal_io::{BeforeAfter, DatasetEvaluation, FrameEvaluation, MeanStd, Rms};
use depthcal_model::{Camera, Context};
use depthcal_statistics::rms;
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use crate::estimators::{MarkerPoint, marker_points};
use crate::observe::board_region::{BoardPixel, BoardPlane, BoardRegion, board_pixels};
use crate::observe::{Capture, DetectedFrame, DroppedFrame};
use crate::start::{FrameMarkers, estimate_pose};

/// A board pixel with its depth before and after correction.
#[derive(Debug, Clone, Copy)]
pub struct PixelError {
    /// The pixel with its covariates.
    pub context: Context,
    /// The board's depth there, mm.
    pub board_depth_mm: f64,
    /// The board point, mm.
    pub board: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cos_incidence: f64,
    /// Measured minus board depth, mm.
    pub before_mm: f64,
    /// Corrected minus board depth, mm.
    pub after_mm: f64,
    /// Height of the measured point over the board, mm (board z).
    pub height_before_mm: f64,
    /// Height of the corrected point over the board, mm.
    pub height_after_mm: f64,
}

/// Errors of one frame.
#[derive(Debug, Clone)]
pub struct EvaluatedFrame {
    /// Its name.
    pub name: String,
    /// Pose from the image alone: maps board coordinates to camera coordinates, mm.
    pub camera_from_board: Isometry3<f64>,
    /// Reprojection errors: detected pixel and detected minus projected, [u, v, du, dv], px.
    pub reprojection: Vec<[f64; 4]>,
    /// Dot errors before and after correction, mm; one pair per marker with depth.
    pub dots: Vec<[f64; 2]>,
    /// All valid board pixels.
    pub pixels: Vec<PixelError>,
    /// Board pixels whose measured depth the camera cannot correct.
    pub uncorrectable: usize,
}

/// Errors of a dataset.
#[derive(Debug, Clone)]
pub struct Evaluated {
    /// Its name.
    pub name: String,
    /// Its frames.
    pub frames: Vec<EvaluatedFrame>,
    /// Frames that were not evaluated, and why.
    pub dropped: Vec<DroppedFrame>,
}

/// Evaluates a camera on all frames of a capture.
pub fn evaluate<F>(camera: &Camera, capture: &Capture<F>) -> Evaluated
where
    F: AsRef<DetectedFrame> + Sync,
{
    // Pixel pieces belong to the correction: uncorrected depth is located by the pixel of the depth image itself.
    let bare = camera.filtered(|block| !crate::adjust::blocks::is_depth_only(block));
    let frames: Vec<Result<EvaluatedFrame, DroppedFrame>> =
        capture.frames.par_iter().map(|frame| evaluate_frame(camera, &bare, capture, frame.as_ref())).collect();
    let mut evaluated = Evaluated { name: capture.name.clone(), frames: Vec::new(), dropped: capture.dropped.clone() };
    for frame in frames {
        match frame {
            Ok(frame) => evaluated.frames.push(frame),
            Err(dropped) => evaluated.dropped.push(dropped),
        }
    }
    evaluated
}

fn evaluate_frame<F>(
    camera: &Camera,
    bare: &Camera,
    capture: &Capture<F>,
    frame: &DetectedFrame,
) -> Result<EvaluatedFrame, DroppedFrame> {
    let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
    let fit = estimate_pose(camera, &capture.target, &markers)
        .map_err(|e| DroppedFrame { name: frame.name.clone(), reason: e.to_string() })?;
    let pose = fit.camera_from_board;
    let reprojection = frame
        .markers
        .iter()
        .filter_map(|m| {
            let p = camera.board_point(capture.target.point(m.index));
            let at = camera.project(&(pose * nalgebra::Point3::from(p)).coords)?;
            Some([m.pixel[0], m.pixel[1], m.pixel[0] - at[0], m.pixel[1] - at[1]])
        })
        .collect();
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    let plane = BoardPlane::new(&pose);
    let region = BoardRegion::new(&capture.target);
    let all = board_pixels(frame, unit_mm, bare, &region, &pose, 1);
    let corrected: Vec<(PixelError, BoardPixel)> = all.iter().filter_map(|p| pixel_error(camera, &plane, p)).collect();
    let (pixels, corrected): (Vec<PixelError>, Vec<BoardPixel>) = corrected.into_iter().unzip();
    let points = |pixels: &[BoardPixel]| marker_points(frame, pixels, bare, &capture.target, &pose);
    let dots = points(&all)
        .into_iter()
        .zip(points(&corrected))
        .filter_map(|(before, after)| Some([dot_distance(&before?), dot_distance(&after?)]))
        .collect();
    let uncorrectable = all.len() - pixels.len();
    let name = frame.name.clone();
    Ok(EvaluatedFrame { name, camera_from_board: pose, reprojection, dots, pixels, uncorrectable })
}

/// Distance between a marker's position on the board and its position by image and depth, mm.
fn dot_distance(point: &MarkerPoint) -> f64 {
    let measured = Vector3::new(point.ray[0], point.ray[1], 1.0) / point.inverse_depth;
    (measured - point.point_in_camera).norm()
}

/// Errors of a board pixel, and the pixel after correction; `None` where the camera cannot correct it.
fn pixel_error(camera: &Camera, plane: &BoardPlane, p: &BoardPixel) -> Option<(PixelError, BoardPixel)> {
    let (ray, rho) = camera.correct_near(&p.context, p.cos_incidence, 1.0 / p.depth_mm, Some(p.ray)).ok()?;
    let board_depth_mm = plane.depth_of_shape(ray, camera)?;
    let on_board = plane.to_board(ray, board_depth_mm);
    let board = [on_board.x, on_board.y];
    let corrected = BoardPixel { depth_mm: 1.0 / rho, board_depth_mm, board, ray, ..*p };
    let error = PixelError {
        context: p.context,
        board_depth_mm: p.board_depth_mm,
        board: p.board,
        cos_incidence: p.cos_incidence,
        before_mm: p.depth_mm - p.board_depth_mm,
        after_mm: corrected.depth_mm - board_depth_mm,
        height_before_mm: plane.height_over_shape(p.ray, p.depth_mm, camera),
        height_after_mm: plane.height_over_shape(ray, corrected.depth_mm, camera),
    };
    Some((error, corrected))
}

/// Mean and standard deviation as a record.
fn mean_std(values: impl Iterator<Item = f64> + Clone) -> MeanStd {
    let (mean, std) = depthcal_statistics::mean_std(values);
    MeanStd { mean, std }
}

impl Evaluated {
    /// The record for `evaluation.json`.
    pub fn record(&self) -> DatasetEvaluation {
        let pixels = || self.frames.iter().flat_map(|f| f.pixels.iter());
        let dots = || self.frames.iter().flat_map(|f| f.dots.iter());
        let errors = || self.frames.iter().flat_map(|f| f.reprojection.iter());
        DatasetEvaluation {
            name: self.name.clone(),
            frames: self.frames.len(),
            reprojection_px: Rms { rms: rms(errors().map(|e| e[2].hypot(e[3]))) },
            dot_error_mm: (dots().count() > 0).then(|| dot_error(dots())),
            plane_error_mm: (pixels().count() > 0).then(|| plane_error(pixels())),
            depth_rms_mm: (pixels().count() > 0).then(|| depth_rms(pixels())),
            frames_detail: self.frames.iter().map(EvaluatedFrame::record).collect(),
        }
    }
}

impl EvaluatedFrame {
    /// The record for `evaluation.json`.
    pub fn record(&self) -> FrameEvaluation {
        FrameEvaluation {
            name: self.name.clone(),
            markers: self.reprojection.len(),
            depth_pixels: self.pixels.len(),
            reprojection_px: Rms { rms: rms(self.reprojection.iter().map(|e| e[2].hypot(e[3]))) },
            dot_error_mm: (!self.dots.is_empty()).then(|| dot_error(self.dots.iter())),
            plane_error_mm: (!self.pixels.is_empty()).then(|| plane_error(self.pixels.iter())),
            depth_rms_mm: (!self.pixels.is_empty()).then(|| depth_rms(self.pixels.iter())),
        }
    }
}

/// Mean and standard deviation of distances between markers and their back-projections (thesis eq. 5.1–5.3).
fn dot_error<'a>(dots: impl Iterator<Item = &'a [f64; 2]> + Clone) -> BeforeAfter<MeanStd> {
    BeforeAfter { before: mean_std(dots.clone().map(|d| d[0])), after: mean_std(dots.map(|d| d[1])) }
}

/// Mean and standard deviation of absolute heights over the board (thesis eq. 5.4, 5.5).
fn plane_error<'a>(pixels: impl Iterator<Item = &'a PixelError> + Clone) -> BeforeAfter<MeanStd> {
    BeforeAfter {
        before: mean_std(pixels.clone().map(|p| p.height_before_mm.abs())),
        after: mean_std(pixels.map(|p| p.height_after_mm.abs())),
    }
}

fn depth_rms<'a>(pixels: impl Iterator<Item = &'a PixelError> + Clone) -> BeforeAfter<f64> {
    BeforeAfter { before: rms(pixels.clone().map(|p| p.before_mm)), after: rms(pixels.map(|p| p.after_mm)) }
}

/// Text of the thesis' table 6.1: errors of every dataset without and with correction. The dataset with the name `marked`, to
/// which the camera was fitted, gets an asterisk.
pub fn table(records: &[DatasetEvaluation], marked: Option<&str>) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:24} {:>6}  {:10} {:>17}  {:>17}  {:>9}  {:>9}",
        "", "", "depth", "dot error/mm", "plane error/mm", "depth rms", "reproj."
    );
    let _ = writeln!(
        text,
        "{:24} {:>6}  {:10} {:>8} {:>8}  {:>8} {:>8}  {:>9}  {:>9}",
        "dataset", "frames", "correction", "mean", "std", "mean", "std", "mm", "px"
    );
    let cell = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.2}"));
    for r in records {
        let star = if marked == Some(r.name.as_str()) { "*" } else { "" };
        for (after, label) in [(false, "no"), (true, "yes")] {
            let pick = |b: Option<BeforeAfter<MeanStd>>| b.map(|b| if after { b.after } else { b.before });
            let (dot, plane) = (pick(r.dot_error_mm), pick(r.plane_error_mm));
            let rms = r.depth_rms_mm.map(|b| if after { b.after } else { b.before });
            let name = if after { String::new() } else { format!("{}{star}", r.name) };
            let frames = if after { String::new() } else { r.frames.to_string() };
            let reprojection = if after { String::new() } else { format!("{:.3}", r.reprojection_px.rms) };
            let _ = writeln!(
                text,
                "{name:24} {frames:>6}  {label:10} {:>8} {:>8}  {:>8} {:>8}  {:>9}  {reprojection:>9}",
                cell(dot.map(|d| d.mean)),
                cell(dot.map(|d| d.std)),
                cell(plane.map(|d| d.mean)),
                cell(plane.map(|d| d.std)),
                cell(rms),
            );
        }
    }
    text
}
