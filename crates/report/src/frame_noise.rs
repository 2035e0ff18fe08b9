//! Test whether whole frames deviate by more than the noise of pixels, of the pose from the image, and of the calibration.

use nalgebra::{Isometry3, SMatrix, SVector, Vector3};

use super::binned::Structure;
use super::finding::{Finding, Over};
use super::format::{number, signed};
use super::pool::{Pool, Pooled};
use super::statistics::rms;
use super::uncertainty::standard_deviations;
use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_calibration::observe::board_plane::BoardPlane;
use depthcal_statistics::{chi_squared_tail, median, quantile};

/// Fewest pixels of a tested frame.
const FEWEST: usize = 20;
/// Rays over which the depth of a pose is averaged.
const RAYS: usize = 25;
/// Deviations up to this multiple of the expected noise are accepted, since that is an estimate itself.
const CLEARLY: f64 = 1.5;

/// A frame's median error and its standard deviation by noise, mm.
struct Offset<'a> {
    frame: &'a Pooled<'a>,
    depth_mm: f64,
    value: f64,
    allowed: f64,
}

/// The finding about whole frames; its `found` is not decided yet. `None` where the calibration has no depth or too few
/// frames have enough pixels.
pub(super) fn offsets(c: &CalibratedCamera, pool: &Pool<'_>, fewest: usize) -> Option<Finding> {
    if !c.with_depth {
        return None;
    }
    // From poses by the image alone: marker noise of a joint fit may contain errors of the depth model.
    let reprojection = |f: &Pooled<'_>| Some(f.frame.record().reprojection_px?.rms);
    let sigma_px =
        quantile(pool.frames.iter().filter_map(reprojection).filter(|r| *r > 0.0), 0.5) / std::f64::consts::SQRT_2;
    let seen: Vec<(&Pooled<'_>, Vec<&PixelError>)> = pool
        .frames
        .iter()
        .map(|f| (f, f.frame.pixels.iter().filter(|p| p.is_usable()).collect::<Vec<_>>()))
        .filter(|(_, p)| p.len() >= FEWEST)
        .collect();
    let centres: Vec<_> = seen.iter().map(|(_, p)| (p[p.len() / 2].context, p[p.len() / 2].board_depth_mm)).collect();
    // The calibration's uncertainty by noise alone: that by frames with planes of their own is what is looked for.
    let by_noise = 1.0 / c.noise.planes.design_effect.sqrt();
    let fit = match &c.covariance {
        Some(covariance) => standard_deviations(c, covariance, &centres).into_iter().map(|s| s * by_noise).collect(),
        None => vec![0.0; seen.len()],
    };
    let apart = c.correlation_length_px.unwrap_or(1) as f64;
    let mut list: Vec<Offset<'_>> = Vec::new();
    for ((frame, pixels), fit) in seen.iter().zip(fit) {
        let Some(pose) = pose_std(c, &frame.frame.camera_from_board, pixels, frame.frame.reprojection.len()) else {
            continue;
        };
        let depth_mm = pixels.iter().map(|p| p.board_depth_mm).sum::<f64>() / pixels.len() as f64;
        let noise = c.noise.depth.sigma(1.0 / depth_mm) * depth_mm.powi(2);
        // The kept pixels are scattered over all of the frame's: as many are independent as fit their distance, at most all kept.
        let independent = (frame.frame.depth.pixels as f64 / (apart * apart)).min(pixels.len() as f64).max(1.0);
        let mean = noise / independent.sqrt();
        let value = median(&mut pixels.iter().map(|p| p.after_mm).collect::<Vec<_>>());
        let allowed = (mean.powi(2) + (sigma_px * pose).powi(2) + fit.powi(2)).sqrt();
        if allowed.is_finite() && allowed > 0.0 {
            list.push(Offset { frame, depth_mm, value, allowed });
        }
    }
    if list.len() < fewest {
        return None;
    }
    let n = list.len() as f64;
    let ratio = list.iter().map(|o| (o.value / o.allowed).powi(2)).sum::<f64>() / n / CLEARLY.powi(2);
    let allowed = rms(list.iter().map(|o| o.allowed));
    let off = rms(list.iter().map(|o| o.value));
    let worst = list.iter().max_by(|a, b| (a.value / a.allowed).abs().total_cmp(&(b.value / b.allowed).abs()))?;
    Some(Finding {
        over: Over::WholeFrames,
        structure: Structure {
            p_value: chi_squared_tail(ratio * n, list.len()),
            size_mm: (off.powi(2) - allowed.powi(2)).max(0.0).sqrt(),
            hidden_mm: CLEARLY * allowed,
        },
        worst: format!(
            "in frame {} at {} mm: {} mm, with a standard deviation of {} mm by noise, pose and fit",
            worst.frame.frame.name,
            number(worst.depth_mm),
            signed(worst.value),
            number(worst.allowed)
        ),
        found: false,
    })
}

/// Standard deviation of the board's mean depth over some pixels, in mm per pixel of marker noise, when the pose comes
/// from the markers.
fn pose_std(c: &CalibratedCamera, pose: &Isometry3<f64>, pixels: &[&PixelError], markers: usize) -> Option<f64> {
    let points = c.capture.target.points();
    let step = pixels.len().div_ceil(RAYS);
    let rays: Vec<[f64; 2]> = pixels
        .iter()
        .step_by(step)
        .filter_map(|p| c.camera.ray(c.camera.image_pixel(&p.context), 1.0 / p.board_depth_mm).ok())
        .collect();
    let moved = |i: usize, by: f64| {
        let d = |k: usize| if i == k { by } else { 0.0 };
        pose * Isometry3::new(Vector3::new(d(0), d(1), d(2)), Vector3::new(d(3), d(4), d(5)))
    };
    let depth = |pose: &Isometry3<f64>| {
        let plane = BoardPlane::new(pose);
        rays.iter().map(|r| plane.depth(*r)).sum::<Option<f64>>().map(|s| s / rays.len() as f64)
    };
    let image_of =
        |pose: &Isometry3<f64>, p: &[f64; 2]| c.camera.project(&(pose * nalgebra::Point3::new(p[0], p[1], 0.0)).coords);
    // Small against the distances and angles of boards, large against rounding.
    let steps = [1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6];
    let mut gradient = SVector::<f64, 6>::zeros();
    let poses: Vec<[Isometry3<f64>; 2]> = (0..6).map(|i| [moved(i, steps[i]), moved(i, -steps[i])]).collect();
    for i in 0..6 {
        gradient[i] = (depth(&poses[i][0])? - depth(&poses[i][1])?) / (2.0 * steps[i]);
    }
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    for p in &points {
        let mut rows = SMatrix::<f64, 2, 6>::zeros();
        for i in 0..6 {
            let (a, b) = (image_of(&poses[i][0], p)?, image_of(&poses[i][1], p)?);
            (0..2).for_each(|r| rows[(r, i)] = (a[r] - b[r]) / (2.0 * steps[i]));
        }
        normal += rows.tr_mul(&rows);
    }
    // As if the found markers were spread like all markers.
    let share = points.len() as f64 / markers.max(1) as f64;
    let variance = (gradient.transpose() * normal.try_inverse()? * gradient).x * share;
    (variance > 0.0).then(|| variance.sqrt())
}
