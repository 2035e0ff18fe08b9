//! Depth on a pixel grid of its own, of another size or place than the image's: unregistered depth of equal size.

use std::fmt;
use std::sync::Arc;

use depthcal_io::{DepthFrame, ImageError};
use depthcal_model::Camera;
use rayon::prelude::*;

use super::depth_points::{BoardPoint, board_points, of_scale};
use crate::observe::{CameraFrames, PosedFrame};

/// Ratios of the focal lengths that are tried, and the factor from one to the next.
const RATIOS: (f64, usize, f64) = (0.5, 32, 1.04);
/// Displacements that are tried, in steps per side, and the step as a share of the image's width.
const SHIFTS: (i32, f64) = (4, 0.025);
/// Trials that are refined, and the smallest step of the refinement as a part of that from one trial to the next.
const REFINED: usize = 8;
const LEAST_STEP: f64 = 0.05;
/// Clearly better than the declaration is this share of its deviation …
const CLEARLY: f64 = 0.25;
/// … and at most this one.
const MOST: f64 = 0.015;
/// Least displacement at the border of the image, as a share of its width: less is an error of the camera.
const LEAST_DISPLACED: f64 = 0.04;
/// Scales of depth that a depth camera may have.
const PLAUSIBLE: [f64; 2] = [0.9, 1.1];
/// Least share of the points that have depth.
const LEAST_COVERAGE: f64 = 0.5;

/// How the grid of depth lies on the image's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// Focal length of the depth image over that of the image.
    pub ratio: f64,
    /// Displacement of the depth image, px.
    pub shift_px: [f64; 2],
    /// Relative deviation of depth from the boards on this grid.
    pub relative: f64,
}

impl Registration {
    /// Largest displacement along the rows or columns, at the border of an image with this centre, px.
    fn displacement_px(&self, centre: [f64; 2]) -> f64 {
        let along = |axis: usize| (self.ratio - 1.0).abs() * centre[axis] + self.shift_px[axis].abs();
        along(0).max(along(1))
    }
}

impl fmt::Display for Registration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [right, down] = self.shift_px;
        write!(
            f,
            "depth and images are not on one pixel grid: depth fits where its focal length is {:.2} times that of the images, and its pixels \
             are displaced by ({right:.0}, {down:.0}) px, about; register depth to the images, or declare them as cameras of a rig, [cameras.image] \
             and [cameras.depth]",
            self.ratio
        )
    }
}

/// The grid on which depth fits clearly better than on the image's, where its deviation is `declared`, in the frames `chosen`.
///
/// # Errors
///
/// [`ImageError`] where a depth image has become unreadable.
pub(super) fn registration(
    capture: &CameraFrames<PosedFrame>,
    camera: &Camera,
    chosen: &[usize],
    unit_mm: f64,
    declared: f64,
) -> Result<Option<Registration>, ImageError> {
    let frames = chosen.iter().filter_map(|i| {
        let frame = &capture.frames[*i];
        Some((board_points(capture, camera, frame), frame.depth_image()?.get()))
    });
    let frames = frames.map(|(points, depth)| Ok((points, depth?))).collect::<Result<Vec<_>, ImageError>>()?;
    let count: usize = frames.iter().map(|(points, _)| points.len()).sum();
    let centre = [(capture.width as f64 - 1.0) / 2.0, (capture.height as f64 - 1.0) / 2.0];
    let (least, ratios, factor) = RATIOS;
    let (shifts, share) = SHIFTS;
    let step = share * capture.width as f64;
    let fit = |ratio: f64, shift_px: [f64; 2]| {
        let logarithms = logarithms(&frames, unit_mm, |pixel| {
            [0, 1].map(|axis| (centre[axis] + ratio * (pixel[axis] - centre[axis]) + shift_px[axis]).round())
        });
        let (scale, relative) = of_scale(&logarithms)?;
        let is_plausible = (PLAUSIBLE[0]..=PLAUSIBLE[1]).contains(&scale.exp());
        let is_covered = logarithms.len() as f64 >= LEAST_COVERAGE * count as f64;
        (is_plausible && is_covered).then_some(Registration { ratio, shift_px, relative })
    };
    let trials: Vec<(f64, [f64; 2])> = (0..ratios)
        .flat_map(|k| (-shifts..=shifts).flat_map(move |i| (-shifts..=shifts).map(move |j| (k, i, j))))
        .map(|(k, i, j)| (least * factor.powi(k as i32), [f64::from(i) * step, f64::from(j) * step]))
        .collect();
    let mut tried: Vec<Registration> =
        trials.into_par_iter().filter_map(|(ratio, shift_px)| fit(ratio, shift_px)).collect();
    tried.sort_by(|a, b| a.relative.total_cmp(&b.relative));
    tried.truncate(REFINED);
    let refined = tried.into_par_iter().map(|start| refine(start, (factor, step), &fit)).collect::<Vec<_>>();
    let best = refined.into_iter().min_by(|a, b| a.relative.total_cmp(&b.relative));
    let is_displaced = |grid: &Registration| grid.displacement_px(centre) >= LEAST_DISPLACED * capture.width as f64;
    Ok(best.filter(|best| best.relative <= MOST.min(CLEARLY * declared) && is_displaced(best)))
}

/// The logarithms of measured over expected depth at the places of the depth images that `place` gives for pixels of the image.
fn logarithms(
    frames: &[(Vec<BoardPoint>, Arc<DepthFrame>)],
    unit_mm: f64,
    place: impl Fn([f64; 2]) -> [f64; 2],
) -> Vec<f64> {
    let of_frame = |(points, depth): &(Vec<BoardPoint>, Arc<DepthFrame>)| {
        let logarithm = |p: &BoardPoint| {
            let [u, v] = place(p.pixel);
            let is_inside = u >= 0.0 && v >= 0.0 && u < depth.width as f64 && v < depth.height as f64;
            let raw = is_inside.then(|| depth.measurement(v as usize * depth.width + u as usize))??;
            Some((raw * unit_mm / p.z_mm).ln())
        };
        points.iter().filter_map(logarithm).collect::<Vec<f64>>()
    };
    frames.iter().flat_map(of_frame).collect()
}

/// A better grid near one, by steps that are halved where none is better; `factor` and `step_px` are those to the next trial.
fn refine(
    start: Registration,
    (factor, step_px): (f64, f64),
    fit: &impl Fn(f64, [f64; 2]) -> Option<Registration>,
) -> Registration {
    let (mut best, mut part) = (start, 0.5);
    while part > LEAST_STEP {
        let Registration { ratio, shift_px: [x, y], .. } = best;
        let (more, step) = (factor.powf(part), part * step_px);
        let neighbours = [
            (ratio * more, [x, y]),
            (ratio / more, [x, y]),
            (ratio, [x + step, y]),
            (ratio, [x - step, y]),
            (ratio, [x, y + step]),
            (ratio, [x, y - step]),
        ];
        let nearest = neighbours.into_iter().filter_map(|(ratio, shift_px)| fit(ratio, shift_px));
        match nearest.min_by(|a, b| a.relative.total_cmp(&b.relative)) {
            Some(better) if better.relative < best.relative => best = better,
            _ => part /= 2.0,
        }
    }
    best
}
