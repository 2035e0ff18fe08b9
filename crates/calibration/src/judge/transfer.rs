//! Transfer errors: markers that one camera sees, taken through its depth into another camera's image.

use std::collections::BTreeMap;

use super::camera::EvaluatedCamera;
use depthcal_io::{TransferAtDistance, TransferError};
use depthcal_model::Camera;
use depthcal_statistics::rms;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::observe::{CameraCapture, PlacedCamera, Taken};

/// Ranges of distance in which errors are reported.
const RANGES: usize = 5;
/// Fewest markers of a range.
const FEWEST: usize = 20;

/// The error of one marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransferPoint {
    /// Where the second camera sees it, px.
    pub pixel: [f64; 2],
    /// Where the first camera's corrected depth puts it, minus that, px.
    pub error_px: [f64; 2],
    /// The error with depth as measured, px.
    pub before_px: [f64; 2],
    /// Distance of the point from the second camera's line of sight, mm.
    pub error_mm: f64,
    /// Depth of the point in the first camera, mm.
    pub distance_mm: f64,
}

/// A camera with its part of a capture, and its errors there.
pub(super) struct JudgedCamera<'a> {
    pub placed: &'a PlacedCamera,
    pub seen: &'a CameraCapture,
    pub errors: EvaluatedCamera,
}

/// Errors from one camera to another.
#[derive(Debug, Clone)]
pub struct Transfer {
    /// The camera whose depth is taken.
    pub from: String,
    /// The camera in whose image they are compared.
    pub to: String,
    /// Its markers.
    pub points: Vec<TransferPoint>,
}

/// Errors between all pairs of cameras with images; pairs without common markers are left out.
pub(super) fn transfers(cameras: &[JudgedCamera<'_>]) -> Vec<Transfer> {
    let mut transfers = Vec::new();
    for from in cameras {
        for to in cameras.iter().filter(|to| to.placed.name != from.placed.name) {
            let points = points(from, to);
            if !points.is_empty() {
                let [from, to] = [from, to].map(|camera| camera.placed.name.clone());
                transfers.push(Transfer { from, to, points });
            }
        }
    }
    transfers
}

fn points(from: &JudgedCamera<'_>, to: &JudgedCamera<'_>) -> Vec<TransferPoint> {
    let (capture, from_errors, to_errors) = (to.seen, &from.errors, &to.errors);
    let (from, to) = (from.placed, to.placed);
    let seen: BTreeMap<&str, BTreeMap<usize, [f64; 2]>> = capture
        .capture
        .frames
        .iter()
        .filter(|frame| to_errors.frames.iter().any(|f| f.name == frame.name))
        .map(|frame| (frame.name.as_str(), frame.markers.iter().map(|m| (m.index, m.pixel)).collect()))
        .collect();
    let mut all = Vec::new();
    for frame in &from_errors.frames {
        let Some(pixels) = seen.get(frame.name.as_str()) else { continue };
        let taken = capture.capture.frames.iter().find(|f| f.name == frame.name).map(|f| Taken::of(f));
        let to_from = taken.map_or_else(|| to.from(from), |taken| to.at(&taken).from(&from.at(&taken)));
        for marker in &frame.markers {
            let Some(pixel) = pixels.get(&marker.index) else { continue };
            let error = |point: [f64; 3]| error(&to.camera, &to_from, point, *pixel);
            if let (Some((error_px, error_mm)), Some((before_px, _))) =
                (error(marker.corrected_mm), error(marker.measured_mm))
            {
                let distance_mm = marker.corrected_mm[2];
                all.push(TransferPoint { pixel: *pixel, error_px, before_px, error_mm, distance_mm });
            }
        }
    }
    all
}

/// Distance in the image (px) and of the point from the line of sight (mm); `None` where the point has no image.
fn error(camera: &Camera, to_from: &Isometry3<f64>, point_mm: [f64; 3], pixel: [f64; 2]) -> Option<([f64; 2], f64)> {
    let point = to_from * Point3::from(point_mm);
    let projected = camera.project(&point.coords)?;
    let [x, y] = camera.ray(pixel, 1.0 / point.z).ok()?;
    let sight = Vector3::new(x, y, 1.0).normalize();
    let off = point.coords - sight * point.coords.dot(&sight);
    Some(([projected[0] - pixel[0], projected[1] - pixel[1]], off.norm()))
}

impl Transfer {
    /// Root mean square, px.
    pub fn rms_px(&self) -> f64 {
        rms(self.points.iter().map(|p| p.error_px[0].hypot(p.error_px[1])))
    }

    /// Root mean square, mm.
    pub fn rms_mm(&self) -> f64 {
        rms(self.points.iter().map(|p| p.error_mm))
    }

    /// The record for `evaluation.json`.
    pub fn record(&self, dataset: &str) -> TransferError {
        TransferError {
            dataset: dataset.to_owned(),
            from: self.from.clone(),
            to: self.to.clone(),
            markers: self.points.len(),
            rms_px: self.rms_px(),
            rms_mm: self.rms_mm(),
            before_rms_px: rms(self.points.iter().map(|p| p.before_px[0].hypot(p.before_px[1]))),
            by_distance: self.by_distance(),
        }
    }

    /// Errors in ranges of distance with equal numbers of markers, from near to far; none where they are few.
    pub fn by_distance(&self) -> Vec<TransferAtDistance> {
        let mut sorted = self.points.clone();
        sorted.sort_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm));
        let size = sorted.len().div_ceil(RANGES).max(FEWEST);
        let range = |points: &[TransferPoint]| TransferAtDistance {
            distance_mm: points.iter().map(|p| p.distance_mm).sum::<f64>() / points.len() as f64,
            markers: points.len(),
            rms_px: rms(points.iter().map(|p| p.error_px[0].hypot(p.error_px[1]))),
            rms_mm: rms(points.iter().map(|p| p.error_mm)),
        };
        sorted.chunks(size).filter(|points| points.len() >= FEWEST).map(range).collect()
    }
}
