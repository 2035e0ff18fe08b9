//! Frames that do not fit the rest: the board moved between image and depth, depth images exchanged, frames stored twice.
//!
//! Such frames are not effects. Left in, they pose as some: a frame whose depth belongs to another pose pulls at everything
//! that varies with pose.

use nalgebra::{Isometry3, SMatrix, SVector, Vector3};

use crate::adjust::adjustment::Adjustment;
use crate::adjust::frame_rows::FrameRows;
use crate::calibrate::Calibrated;
use crate::observe::board_region::{BoardPixel, BoardRegion, board_pixels};
use crate::observe::{Capture, DetectedFrame, SampledFrame};
use depthcal_statistics::chi_squared_tail;

/// A plane of its own exceeds the noise of single pixels by this factor in a bad frame …
const LEAST_OF_NOISE: f64 = 2.0;
/// … and the median of all frames' planes by this.
const OUTLYING: f64 = 6.0;
/// With more than this share of such frames they are not exceptions but something that the model lacks.
const FEW: f64 = 0.15;

/// A frame's plane: how its depth, as a whole, deviates from the pose that its image shows.
#[derive(Debug, Clone)]
pub struct FramePlane {
    /// The frame.
    pub name: String,
    /// Mean offset of the depth, mm, and its rms over the frame's samples.
    pub offset_mm: f64,
    /// Root mean square of the plane over the frame's samples, mm.
    pub rms_mm: f64,
    /// Root mean square of the plane over the standard deviation of single pixels.
    pub of_noise: f64,
    /// Score statistic of the plane: χ² with three degrees of freedom where the frame has none of its own.
    pub statistic: f64,
    /// Its p-value.
    pub p_value: f64,
}

/// A frame that is left out, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadFrame {
    /// The frame.
    pub name: String,
    /// Why, in words.
    pub reason: String,
}

/// The plane of every frame that has depth samples and markers.
pub fn frame_planes(fit: &Calibrated) -> Vec<FramePlane> {
    let adjustment = Adjustment::new(&fit.capture, &fit.camera, &fit.noise, true);
    let mut planes = Vec::new();
    for (index, frame) in fit.capture.frames.iter().enumerate() {
        if frame.samples.is_empty() || frame.markers.is_empty() {
            continue;
        }
        let Some(rows) = adjustment.frame_rows(index) else { continue };
        if let Some(plane) = plane_of(frame, fit, &rows) {
            planes.push(plane);
        }
    }
    planes
}

fn plane_of(frame: &SampledFrame, fit: &Calibrated, rows: &FrameRows) -> Option<FramePlane> {
    let first = rows.residuals.len() - rows.depth;
    let samples = &frame.samples;
    // A plane of the frame's own adds a + b u + c v to the measured inverse depth; pixels are scaled to about one.
    let (width, height) = (fit.camera.width as f64, fit.camera.height as f64);
    let shape = |k: usize| {
        let [u, v] = samples[k].context.pixel;
        Vector3::new(1.0, 2.0 * u / width - 1.0, 2.0 * v / height - 1.0)
    };
    let sigma = |k: usize| fit.noise.depth.sigma(1.0 / samples[k].depth_mm);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut rhs = SVector::<f64, 9>::zeros();
    for row in 0..rows.residuals.len() {
        let mut columns = SVector::<f64, 9>::zeros();
        for c in 0..6 {
            columns[c] = rows.pose[(row, c)];
        }
        if row >= first {
            // The adjustment's residual is predicted minus measured: what the plane adds is predicted.
            let k = row - first;
            columns.fixed_rows_mut::<3>(6).copy_from(&(shape(k) / sigma(k)));
        }
        normal += columns * columns.transpose();
        rhs += columns * rows.residuals[row];
    }
    let step = -normal.cholesky()?.solve(&rhs);
    let covariance = normal.try_inverse()?;
    let plane = step.fixed_rows::<3>(6).into_owned();
    let information = covariance.fixed_view::<3, 3>(6, 6).into_owned().try_inverse()?;
    let statistic = plane.dot(&(information * plane));
    let (mut sum, mut squares, mut of_noise) = (0.0, 0.0, 0.0);
    for (k, sample) in samples.iter().enumerate() {
        let d_rho = shape(k).dot(&plane);
        let mm = -d_rho * sample.depth_mm * sample.depth_mm;
        sum += mm;
        squares += mm * mm;
        of_noise += (d_rho / sigma(k)).powi(2);
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

/// Frames whose own plane is out of proportion to all others' and at least `least_mm` rms. Empty where they are too many to
/// be exceptions.
pub fn outlying(planes: &[FramePlane], least_mm: f64) -> Vec<&FramePlane> {
    let mut sizes: Vec<f64> = planes.iter().map(|p| p.of_noise).collect();
    sizes.sort_by(f64::total_cmp);
    let Some(median) = sizes.get(sizes.len() / 2).copied() else { return Vec::new() };
    let is_bad = |p: &&FramePlane| p.of_noise > LEAST_OF_NOISE && p.of_noise > OUTLYING * median && p.rms_mm > least_mm;
    let bad: Vec<&FramePlane> = planes.iter().filter(is_bad).collect();
    if bad.len() as f64 > FEW * planes.len() as f64 { Vec::new() } else { bad }
}

/// Share of frames that have a plane of their own which noise does not explain and which is not small against it.
pub fn share_with_own_plane(planes: &[FramePlane]) -> f64 {
    let level = 0.01 / planes.len().max(1) as f64;
    let own = planes.iter().filter(|p| p.p_value < level && p.of_noise > 0.5).count();
    own as f64 / planes.len().max(1) as f64
}

/// What is wrong with bad frames, in words: depth images exchanged among themselves, or depth that does not belong to the
/// image.
pub fn explain(fit: &Calibrated, bad: &[&FramePlane]) -> Vec<BadFrame> {
    let pose_of = |i: usize| fit.capture.frames[i].camera_from_board;
    let find = |name: &str| fit.capture.frames.iter().position(|f| f.name == name);
    let indices: Vec<usize> = bad.iter().filter_map(|p| find(&p.name)).collect();
    bad.iter()
        .map(|plane| {
            let own = find(&plane.name);
            // Its board's depth under the pose of another bad frame.
            let partner = own.and_then(|own| {
                let before = deviation(fit, own, &pose_of(own))?;
                let rest = indices.iter().filter(|i| **i != own);
                rest.filter_map(|i| Some((*i, deviation(fit, own, &pose_of(*i))?)))
                    .filter(|(_, after)| *after < 0.2 * before)
                    .min_by(|a, b| a.1.total_cmp(&b.1))
            });
            let reason = match partner {
                Some((other, _)) => format!(
                    "its depth image fits the pose of {}: the two depth images seem to be exchanged",
                    fit.capture.frames[other].name
                ),
                None => format!(
                    "its depth deviates from its image by a plane of its own ({:+.1} mm in the middle, {:.1} mm rms): the \
                     board or the camera seems to have moved between the two",
                    plane.offset_mm, plane.rms_mm
                ),
            };
            BadFrame { name: plane.name.clone(), reason }
        })
        .collect()
}

/// Median absolute deviation of a frame's depth image from the board in another pose, mm.
fn deviation(fit: &Calibrated, frame: usize, pose: &Isometry3<f64>) -> Option<f64> {
    const STRIDE: usize = 5;
    let region = BoardRegion::new(&fit.capture.target);
    let unit_mm = fit.capture.depth_unit_mm?;
    let pixels = board_pixels(&fit.capture.frames[frame], unit_mm, &fit.camera, &region, pose, STRIDE);
    let corrected =
        |p: &BoardPixel| Some(1.0 / fit.camera.correct(&p.context, p.cos_incidence, 1.0 / p.depth_mm).ok()?.1);
    let mut deviations: Vec<f64> =
        pixels.iter().filter_map(|p| corrected(p).map(|z| (z - p.board_depth_mm).abs())).collect();
    deviations.sort_by(f64::total_cmp);
    deviations.get(deviations.len() / 2).copied()
}

/// Takes out frames that are copies of earlier ones: the same markers to the last digit, or the same depth image.
pub fn without_duplicates(capture: &Capture) -> (Capture, Vec<BadFrame>) {
    let mut bad = Vec::new();
    let mut kept: Vec<&DetectedFrame> = Vec::new();
    for frame in &capture.frames {
        let twin = kept.iter().find(|k| same_markers(k, frame) || same_depth(k, frame));
        match twin {
            Some(twin) => {
                let what = if same_markers(twin, frame) { "image" } else { "depth image" };
                let reason = format!("its {what} is that of {}: the frame is stored twice", twin.name);
                bad.push(BadFrame { name: frame.name.clone(), reason });
            }
            None => kept.push(frame),
        }
    }
    (capture.subset(|_, f| bad.iter().all(|b| b.name != f.name)), bad)
}

fn same_markers(a: &DetectedFrame, b: &DetectedFrame) -> bool {
    a.markers.len() >= 4
        && a.markers.len() == b.markers.len()
        && a.markers.iter().zip(&b.markers).all(|(m, n)| m.index == n.index && m.pixel == n.pixel)
}

fn same_depth(a: &DetectedFrame, b: &DetectedFrame) -> bool {
    matches!((a.depth_image(), b.depth_image()), (Some(a), Some(b)) if a.data == b.data && a.data.iter().any(|d| *d > 0))
}
