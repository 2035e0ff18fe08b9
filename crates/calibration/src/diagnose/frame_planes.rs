//! Deviation of every frame's depth, as a whole, from the pose that its image shows: a plane in inverse depth.

use super::thresholds::Thresholds;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::frame_rows::FrameRows;
use crate::adjust::plane_scatter::{own_plane, plane_shapes};
use crate::calibrate::CalibratedCamera;
use crate::observe::SampledFrame;
use crate::observe::noise::{NoiseModel, PlaneScatter};
use depthcal_statistics::{chi_squared_tail, upper_median};

/// A frame's plane a + b u + c v, estimated jointly with the frame's pose, by which its measured inverse depth deviates.
#[derive(Debug, Clone)]
pub struct FramePlane {
    /// The frame.
    pub name: String,
    /// Mean of the plane over the frame's samples, mm of depth.
    pub offset_mm: f64,
    /// Root mean square of the plane over the frame's samples, mm of depth.
    pub rms_mm: f64,
    /// Root mean square of the plane in standard deviations of single pixels.
    pub of_noise: f64,
    /// Score statistic: χ² with three degrees of freedom where the frame does not deviate.
    pub statistic: f64,
    /// p-value of the statistic.
    pub p_value: f64,
}

/// The planes of the frames that have depth samples and markers, given the fitted camera.
pub fn frame_planes(fit: &CalibratedCamera) -> Vec<FramePlane> {
    let noise = NoiseModel { planes: PlaneScatter::NONE, ..fit.noise };
    let adjustment = Adjustment::new(&fit.capture, &fit.camera, &noise, true);
    let mut planes = Vec::new();
    for (index, frame) in fit.capture.frames.iter().enumerate() {
        if frame.samples.is_empty() || frame.markers.is_empty() {
            continue;
        }
        let Some(rows) = adjustment.frame_rows(0, index) else { continue };
        if let Some(plane) = plane_of(frame, fit, &rows) {
            planes.push(plane);
        }
    }
    planes
}

/// The plane of one frame from its residuals and their derivatives by the pose; `None` where they do not determine it.
fn plane_of(frame: &SampledFrame, fit: &CalibratedCamera, rows: &FrameRows) -> Option<FramePlane> {
    let samples = &frame.samples;
    let placed: Vec<_> = samples.iter().map(|s| (s.context, 1.0 / s.depth_mm)).collect();
    let shapes = plane_shapes(&fit.camera, &placed, &fit.noise.depth);
    let fitted = own_plane(rows, &shapes)?;
    let statistic = fitted.statistic();
    let (mut sum, mut squares, mut of_noise) = (0.0, 0.0, 0.0);
    for (k, sample) in samples.iter().enumerate() {
        let in_noise = shapes[k].dot(&fitted.plane);
        let mm = -in_noise * fit.noise.depth.sigma(1.0 / sample.depth_mm) * sample.depth_mm * sample.depth_mm;
        sum += mm;
        squares += mm * mm;
        of_noise += in_noise * in_noise;
    }
    let n = samples.len() as f64;
    Some(FramePlane {
        name: frame.name.clone(),
        offset_mm: sum / n,
        rms_mm: (squares / n).sqrt(),
        of_noise: (of_noise / n).sqrt(),
        statistic,
        p_value: chi_squared_tail(statistic, 3),
    })
}

/// Frames whose plane is out of proportion to those of the others and larger than `least_mm` rms. Empty where they are too many
/// to be exceptions.
pub fn outlying<'a>(planes: &'a [FramePlane], least_mm: f64, thresholds: &Thresholds) -> Vec<&'a FramePlane> {
    let mut sizes: Vec<f64> = planes.iter().map(|p| p.of_noise).collect();
    let Some(median) = upper_median(&mut sizes) else { return Vec::new() };
    let is_bad = |p: &&FramePlane| {
        p.of_noise > thresholds.outlying_plane_of_noise
            && p.of_noise > thresholds.outlying_plane_of_median * median
            && p.rms_mm > least_mm
    };
    let bad: Vec<&FramePlane> = planes.iter().filter(is_bad).collect();
    let too_many = bad.len() as f64 > thresholds.most_outlying_share * planes.len() as f64;
    if too_many { Vec::new() } else { bad }
}

/// Share of the frames whose plane is significant and not small against the noise of single pixels.
pub fn share_with_own_plane(planes: &[FramePlane], thresholds: &Thresholds) -> f64 {
    let level = thresholds.own_plane_level / planes.len().max(1) as f64;
    let significant = planes.iter().filter(|p| p.p_value < level && p.of_noise > thresholds.own_plane_of_noise).count();
    significant as f64 / planes.len().max(1) as f64
}
