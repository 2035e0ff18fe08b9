//! Whether the standard deviations of corrected depth hold: the share of held-out board pixels within 95 % intervals, by bins of
//! depth, amplitude and place in the image.
//!
//! `cargo run --release -p depthcal-studies --bin sigma_study -- DATASET [MODEL]`
//!
//! Every third of the frames in turn is held out and the others are fitted. The reference is the board with the pose that its
//! markers give, whose own uncertainty is a part of the deviation; the first column is without it, the second with it.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;

use depthcal_calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal_calibration::depth_uncertainty::uncertain_depth_of;
use depthcal_calibration::judge::camera::{EvaluatedFrame, evaluate_camera};
use depthcal_calibration::judge::cross_validation::split;
use depthcal_calibration::load::{LoadOptions, load};
use depthcal_calibration::observe::board_plane::BoardPlane;
use depthcal_model::Context;
use depthcal_statistics::quantile;
use nalgebra::{Isometry3, Point3, SMatrix, SVector, Vector3};

/// Number of parts of which each is held out once.
const PARTS: usize = 3;
/// Half width of a 95 % interval of a normal variable, standard deviations.
const HALF_WIDTH: f64 = 1.959_964;

/// A held-out pixel.
struct Pixel {
    depth_mm: f64,
    amplitude: f64,
    /// Distance from the middle over that of the corner.
    radius: f64,
    error_mm: f64,
    sigma_mm: f64,
    pose_mm: f64,
}

/// Covariance of a pose from its markers, of (translation, rotation) in the board's frame.
fn pose_covariance(fit: &CalibratedCamera, frame: &EvaluatedFrame) -> Option<SMatrix<f64, 6, 6>> {
    let points = fit.capture.target.points();
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let pixel = |pose: &Isometry3<f64>, p: &[f64; 2]| fit.camera.project(&(pose * Point3::new(p[0], p[1], 0.0)).coords);
    for point in &points {
        let mut rows = SMatrix::<f64, 2, 6>::zeros();
        for i in 0..6 {
            let [plus, minus] = moved(&frame.camera_from_board, i).map(|pose| pixel(&pose, point));
            let (plus, minus) = (plus?, minus?);
            (0..2).for_each(|r| rows[(r, i)] = (plus[r] - minus[r]) / (2.0 * STEPS[i]));
        }
        normal += rows.tr_mul(&rows) / fit.noise.pixel_sigma.powi(2);
    }
    // As if the markers that were found were spread like all.
    Some(normal.try_inverse()? * (points.len() as f64 / frame.reprojection.len().max(1) as f64))
}

/// Small against distances and angles of boards, large against rounding.
const STEPS: [f64; 6] = [1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6];

fn moved(pose: &Isometry3<f64>, i: usize) -> [Isometry3<f64>; 2] {
    [STEPS[i], -STEPS[i]].map(|by| {
        let d = |k: usize| if i == k { by } else { 0.0 };
        pose * Isometry3::new(Vector3::new(d(0), d(1), d(2)), Vector3::new(d(3), d(4), d(5)))
    })
}

fn pixels_of(fit: &CalibratedCamera, frame: &EvaluatedFrame) -> Option<Vec<Pixel>> {
    let depth = uncertain_depth_of(fit, fit.covariance.as_ref()?, Context::default());
    let covariance = pose_covariance(fit, frame)?;
    let (w, h) = (fit.camera.width as f64, fit.camera.height as f64);
    let planes: Vec<[BoardPlane; 2]> =
        (0..6).map(|i| moved(&frame.camera_from_board, i).map(|pose| BoardPlane::new(&pose))).collect();
    let pixel = |p: &depthcal_calibration::judge::depth_errors::PixelError| {
        let ray = fit.camera.ray(fit.camera.image_pixel(&p.context), 1.0 / p.board_depth_mm).ok()?;
        let mut gradient = SVector::<f64, 6>::zeros();
        for (i, [plus, minus]) in planes.iter().enumerate() {
            gradient[i] = (plus.depth(ray)? - minus.depth(ray)?) / (2.0 * STEPS[i]);
        }
        let [u, v] = p.context.pixel;
        Some(Pixel {
            depth_mm: p.board_depth_mm,
            amplitude: p.context.amplitude,
            radius: (u - 0.5 * w).hypot(v - 0.5 * h) / (0.5 * w).hypot(0.5 * h),
            error_mm: p.after_mm,
            sigma_mm: depth.std_dev(&p.context, p.board_depth_mm + p.before_mm).total_mm(),
            pose_mm: (gradient.transpose() * covariance * gradient).x.max(0.0).sqrt(),
        })
    };
    Some(frame.pixels.iter().step_by(4).filter_map(pixel).filter(|p| p.sigma_mm.is_finite()).collect())
}

/// Shares within the intervals without and with the pose's uncertainty, and root mean squares of error and σ.
fn row(name: &str, pixels: &[&Pixel]) {
    let n = pixels.len() as f64;
    let within = |sigma: &dyn Fn(&Pixel) -> f64| {
        100.0 * pixels.iter().filter(|p| p.error_mm.abs() <= HALF_WIDTH * sigma(p)).count() as f64 / n
    };
    let rms = |value: &dyn Fn(&Pixel) -> f64| (pixels.iter().map(|p| value(p).powi(2)).sum::<f64>() / n).sqrt();
    println!(
        "| {name} | {} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} |",
        pixels.len(),
        within(&|p| p.sigma_mm),
        within(&|p| p.sigma_mm.hypot(p.pose_mm)),
        rms(&|p| p.error_mm),
        rms(&|p| p.sigma_mm),
        rms(&|p| p.pose_mm)
    );
}

fn thirds(name: &str, pixels: &[Pixel], value: impl Fn(&Pixel) -> f64) {
    let edges = [1.0 / 3.0, 2.0 / 3.0].map(|q| quantile(pixels.iter().map(&value), q));
    let third = |p: &Pixel| edges.iter().filter(|edge| value(p) > **edge).count();
    for k in 0..3 {
        let part: Vec<&Pixel> = pixels.iter().filter(|p| third(p) == k).collect();
        if !part.is_empty() {
            let mean = part.iter().map(|p| value(p)).sum::<f64>() / part.len() as f64;
            row(&format!("{name}, mean {mean:.3}"), &part);
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("usage: sigma_study DATASET [MODEL]")?;
    let loaded = load(path.as_ref(), &LoadOptions::default())?.into_only_camera()?;
    let mut options = CameraOptions::default().for_board(&loaded.capture.target);
    if let Some(model) = arguments.next() {
        options.model = model.parse()?;
    }
    let mut pixels = Vec::new();
    for part in 0..PARTS {
        let (fitted, held_out) = split(&loaded.capture, PARTS, part);
        let fit = calibrate_camera(&fitted, &options)?;
        println!(
            "part {part}: {} frames, noise a {:.3e} 1/mm, b {:.3} mm, planes {:?}",
            fit.capture.frames.len(),
            fit.noise.depth.a_per_mm,
            fit.noise.depth.b_mm,
            fit.noise.planes.deviations
        );
        let evaluated = evaluate_camera(&fit.camera, &held_out);
        pixels.extend(evaluated.frames.iter().filter_map(|frame| pixels_of(&fit, frame)).flatten());
    }
    println!(
        "| bin | pixels | within 95 % | with the pose's | error rms mm | σ rms mm | pose rms mm |\n|---|---|---|---|---|---|---|"
    );
    row("all", &pixels.iter().collect::<Vec<_>>());
    thirds("depth mm", &pixels, |p| p.depth_mm);
    if pixels.iter().all(|p| p.amplitude.is_finite()) {
        thirds("amplitude", &pixels, |p| p.amplitude);
    }
    thirds("distance from the middle", &pixels, |p| p.radius);
    Ok(())
}
