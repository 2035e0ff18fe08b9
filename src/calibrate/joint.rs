//! Everything in one adjustment: markers and depth pixels, with the noise of both estimated on the way.

use depthcal_model::field::Domain;
use depthcal_model::{Block, Camera};
use nalgebra::Isometry3;

use super::{
    CalibrateError, CalibrateOptions, Calibrated, LEAST_INVERSE_DEPTH_SIGMA, LEAST_PIXEL_SIGMA, NOISE_SETTLED, ROUNDS,
    converged, finish,
};
use crate::adjustment::Adjustment;
use crate::board_region::BoardPlane;
use crate::cells;
use crate::depth_sampling::sample_depth;
use crate::noise::{DepthNoise, NoiseModel, clipped_sigma};
use crate::observations::Capture;
use crate::roughness;
use crate::smoothness::{Smoothness, hold_untouched};

/// Depth samples beyond this many standard deviations are outliers.
const OUTLIER: f64 = 8.0;

/// Adds the depth pieces to a camera that was fitted to the images, and adjusts everything jointly.
pub(super) fn joint(
    from_image: Calibrated,
    depth_blocks: Vec<Block>,
    options: &CalibrateOptions,
) -> Result<Calibrated, CalibrateError> {
    let mut capture = from_image.capture.clone();
    let mut correlation = None;
    if capture.frames.iter().any(|f| f.depth.is_some()) {
        let sampling = sample_depth(&mut capture, &from_image.camera, &from_image.poses, options.samples_per_frame);
        correlation = Some(sampling.correlation_length_px);
    }
    seed_samples(&mut capture, &from_image);
    if capture.frames.iter().all(|f| f.samples.is_empty()) {
        return Err(CalibrateError::NoDepthOnBoard { dataset: capture.name });
    }
    let domain = seen(&capture);
    let mut camera = from_image.camera.clone();
    for block in depth_blocks {
        camera = camera.with_block(block.over(&domain));
    }
    camera = hold_untouched(&camera, &capture);
    let start = Start {
        poses: from_image.poses.clone(),
        noise: NoiseModel { depth: depth_noise_from_planes(&capture), ..from_image.noise },
        smoothness: Smoothness::of(&camera),
    };
    let mut result = match cells::coarse(&camera, &options.register, &domain)? {
        None => rounds(capture, camera, start, options)?,
        Some((coarse, factors)) => by_node(capture, &camera, (&coarse, &factors), start, options)?,
    };
    result.correlation_length_px = correlation;
    check_invertible(&result)?;
    Ok(result)
}

/// Where an adjustment starts, beside the camera.
struct Start {
    poses: Vec<Isometry3<f64>>,
    noise: NoiseModel,
    smoothness: Smoothness,
}

/// Adjusts until noise, roughness and outliers have settled.
fn rounds(
    mut capture: Capture,
    mut camera: Camera,
    start: Start,
    options: &CalibrateOptions,
) -> Result<Calibrated, CalibrateError> {
    let Start { mut poses, mut noise, mut smoothness } = start;
    let mut outliers = 0;
    let mut round = 0;
    loop {
        round += 1;
        let mut adjustment = Adjustment::new(&capture, &camera, &poses, &noise, true).with_smoothness(&smoothness);
        let adjusted = adjustment.solve()?;
        (camera, poses) = (adjusted.camera.clone(), adjusted.poses.clone());
        let used = noise;
        let covariance = adjustment.covariance()?;
        let (image_redundancy, depth_redundancy) = adjustment.redundancies(&covariance);
        let inflation = |n: usize, redundancy: f64| n as f64 / redundancy.max(1.0);
        let n = adjusted.image_residuals.len();
        noise.pixel_sigma *= clipped_sigma(&adjusted.image_residuals) * inflation(n, image_redundancy).sqrt();
        noise.pixel_sigma = noise.pixel_sigma.max(LEAST_PIXEL_SIGMA);
        let residuals = inverse_depth_residuals(&capture, &adjusted.depth_residuals, &used);
        if let Some(law) = DepthNoise::fit(&residuals, inflation(residuals.len(), depth_redundancy)) {
            noise.depth = DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law };
        }
        // The last round keeps its samples, so that the result belongs to them.
        let dropped = if round < ROUNDS { drop_outliers(&mut capture, &residuals, &noise) } else { 0 };
        outliers += dropped;
        let settled = (noise.pixel_sigma / used.pixel_sigma - 1.0).abs() < NOISE_SETTLED
            && residuals
                .iter()
                .all(|(rho, _)| (noise.depth.sigma(*rho) / used.depth.sigma(*rho) - 1.0).abs() < 2.0 * NOISE_SETTLED);
        let mut rough_enough = true;
        if !smoothness.fields.is_empty() && round < ROUNDS {
            let chosen = roughness::choose(&adjusted.camera, &smoothness, &adjustment.frame_information());
            rough_enough = chosen.close_to(&smoothness);
            smoothness = chosen;
        }
        if dropped == 0 && ((settled && rough_enough) || round >= ROUNDS) {
            converged(&adjusted)?;
            let camera_covariance = adjustment.camera_covariance(&covariance);
            let depth_mm = depth_residuals_mm(&capture, &adjusted.depth_residuals, &used);
            let (sigma, covariance) = (used.pixel_sigma, Some(camera_covariance));
            let mut result = finish(capture, adjusted, noise, sigma, covariance, Some(&depth_mm), options);
            result.outliers = outliers;
            result.smoothness = smoothness;
            return Ok(result);
        }
    }
}

/// Depth samples of a frame from which the roughness of a large field is chosen.
const COARSE_SAMPLES: usize = 800;
/// Change of the noise after which a large field is adjusted again.
const NOISE_CHANGED: f64 = 0.1;

/// Adjusts a camera with fields of very many nodes. Covariances are out of reach there: noise and roughness come from a
/// coarse field on part of the samples. What roughness means does not depend on the number of nodes: the second difference
/// of a given curvature falls with the square of their distance h and their number grows with its inverse square, so that
/// the same energy of curvature costs the same where roughness is proportional to h.
fn by_node(
    mut capture: Capture,
    camera: &Camera,
    (coarse, factors): (&Camera, &[f64]),
    start: Start,
    options: &CalibrateOptions,
) -> Result<Calibrated, CalibrateError> {
    let mut thin = capture.clone();
    for frame in &mut thin.frames {
        let step = frame.samples.len().div_ceil(COARSE_SAMPLES).max(1);
        frame.samples = frame.samples.iter().step_by(step).copied().collect();
    }
    let coarse = hold_untouched(coarse, &thin);
    let first = rounds(thin, coarse.clone(), Start { smoothness: Smoothness::of(&coarse), ..start }, options)?;
    let mut smoothness = Smoothness { ridge: first.smoothness.ridge, ..Smoothness::of(camera) };
    for (field, coarse) in smoothness.fields.iter_mut().zip(&first.smoothness.fields) {
        let block = camera.blocks().iter().position(|b| b.name() == field.piece);
        field.roughness = coarse.roughness / block.map_or(1.0, |i| factors[i]);
    }
    let mut camera = camera.map_blocks(|mut block| {
        let fitted = first.camera.block(block.name()).filter(|b| b.theta.len() == block.theta.len());
        if let Some(fitted) = fitted {
            block.theta.clone_from(&fitted.theta);
        }
        block
    });
    cells::sort_by_cell(&mut capture, &camera);
    let (mut poses, mut noise, mut outliers) = (first.poses, first.noise, 0);
    let mut round = 0;
    loop {
        round += 1;
        let mut adjustment = Adjustment::new(&capture, &camera, &poses, &noise, true).with_smoothness(&smoothness);
        let adjusted = adjustment.solve()?;
        (camera, poses) = (adjusted.camera.clone(), adjusted.poses.clone());
        let used = noise;
        let residuals = inverse_depth_residuals(&capture, &adjusted.depth_residuals, &used);
        // Counting every node as a parameter errs on the side of more noise.
        let (n, nodes) = (residuals.len(), smoothness.fields.iter().map(|f| f.nodes).sum::<usize>());
        let inflation = n as f64 / (n as f64 - nodes as f64).max(0.5 * n as f64);
        if let Some(law) = DepthNoise::fit(&residuals, inflation) {
            noise.depth = DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law };
        }
        // The last round keeps its samples, so that the result belongs to them.
        let dropped = if round == 1 { drop_outliers(&mut capture, &residuals, &noise) } else { 0 };
        outliers += dropped;
        let changed = residuals
            .iter()
            .step_by(97)
            .any(|(rho, _)| (noise.depth.sigma(*rho) / used.depth.sigma(*rho)).ln().abs() > NOISE_CHANGED);
        if (dropped == 0 && !changed) || round >= ROUNDS {
            converged(&adjusted)?;
            let depth_mm = depth_residuals_mm(&capture, &adjusted.depth_residuals, &used);
            let mut result = finish(capture, adjusted, noise, used.pixel_sigma, None, Some(&depth_mm), options);
            (result.outliers, result.smoothness) = (outliers, smoothness);
            return Ok(result);
        }
    }
}

/// The image and the depths that were seen, but for the outermost half per cent.
fn seen(capture: &Capture) -> Domain {
    let mut depths: Vec<f64> = capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| s.depth_mm)).collect();
    depths.sort_by(f64::total_cmp);
    let cut = depths.len() / 200;
    let range = [depths[cut], depths[depths.len() - 1 - cut]];
    Domain {
        size_px: [capture.width as f64, capture.height as f64],
        depth_mm: (range[1] > 1.01 * range[0]).then_some(range),
    }
}

/// Depth noise to start with: deviations from a plane of each frame's own.
fn depth_noise_from_planes(capture: &Capture) -> DepthNoise {
    let mut samples = Vec::new();
    for frame in &capture.frames {
        let pixels: Vec<_> = frame
            .samples
            .iter()
            .map(|s| crate::board_region::BoardPixel {
                context: s.context,
                depth_mm: s.depth_mm,
                board_depth_mm: s.depth_mm,
                board: s.board_seed,
                // Pixels instead of rays: a plane is affine in either, up to the lens.
                ray: [s.context.pixel[0] / 1000.0, s.context.pixel[1] / 1000.0],
                cos_incidence: 1.0,
            })
            .collect();
        let deviations = crate::depth_sampling::plane_deviations(&pixels);
        samples.extend(pixels.iter().zip(deviations).map(|(p, d)| (1.0 / p.depth_mm, d)));
    }
    let law = DepthNoise::fit(&samples, 1.0).unwrap_or(DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 });
    DepthNoise { a_per_mm: law.a_per_mm.max(LEAST_INVERSE_DEPTH_SIGMA), ..law }
}

/// Gives samples that came without a depth image the board point that their ray meets; those that meet none go.
fn seed_samples(capture: &mut Capture, from_image: &Calibrated) {
    for (frame, pose) in capture.frames.iter_mut().zip(&from_image.poses) {
        let plane = BoardPlane::new(pose);
        frame.samples.retain_mut(|sample| {
            if sample.board_seed[0].is_finite() {
                return true;
            }
            let ray = from_image.camera.ray(sample.context.pixel, 1.0 / sample.depth_mm).ok();
            let point = ray.and_then(|ray| plane.depth(ray).map(|z| plane.to_board(ray, z)));
            sample.board_seed = point.map_or([f64::NAN; 2], |p| [p.x, p.y]);
            point.is_some()
        });
    }
}

/// (inverse depth, residual in inverse depth) of every sample, 1/mm.
fn inverse_depth_residuals(capture: &Capture, whitened: &[f64], noise: &NoiseModel) -> Vec<(f64, f64)> {
    let samples = capture.frames.iter().flat_map(|f| f.samples.iter());
    samples
        .zip(whitened)
        .map(|(s, r)| {
            let rho = 1.0 / s.depth_mm;
            (rho, r * noise.depth.sigma(rho))
        })
        .collect()
}

/// Measured minus predicted depth of every sample, mm.
fn depth_residuals_mm(capture: &Capture, whitened: &[f64], noise: &NoiseModel) -> Vec<f64> {
    inverse_depth_residuals(capture, whitened, noise).iter().map(|(rho, r)| 1.0 / rho - 1.0 / (rho + r)).collect()
}

/// Takes samples out that no noise explains; returns how many.
fn drop_outliers(capture: &mut Capture, residuals: &[(f64, f64)], noise: &NoiseModel) -> usize {
    let mut rest = residuals.iter();
    let mut dropped = 0;
    for frame in &mut capture.frames {
        frame.samples.retain(|_| {
            let keep = rest.next().is_none_or(|(rho, r)| r.abs() <= OUTLIER * noise.depth.sigma(*rho));
            dropped += usize::from(!keep);
            keep
        });
    }
    dropped
}

/// Depths on every ray at which folds are looked for.
const FOLD_STEPS: usize = 60;

/// The fitted camera must be invertible at every sample that it was fitted to, and must not fold between the nearest and
/// the farthest depth that was seen at any of their pixels: a fold between two samples gives one of two depths.
fn check_invertible(result: &Calibrated) -> Result<(), CalibrateError> {
    let range = seen(&result.capture).depth_mm;
    for frame in &result.capture.frames {
        for sample in frame.samples.iter().step_by(10) {
            result.camera.correct(&sample.context, 1.0, 1.0 / sample.depth_mm)?;
        }
        if let Some(range) = range {
            for sample in frame.samples.iter().step_by(40) {
                result.camera.check_depth_folds(&sample.context, range, FOLD_STEPS)?;
            }
        }
    }
    Ok(())
}
