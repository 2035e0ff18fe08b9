//! The order of the lens where the markers do not determine all its terms over the whole image.
//!
//! Terms of high order that are fitted where no marker constrains them leave the corners of the image to chance, up to a lens
//! that folds there. A lens that the markers determine everywhere is fitted as it was asked for: leaving out a term that is
//! only just insignificant would bias the others by more than their standard deviations then say. Otherwise the order is the
//! simplest whose error on left-out frames is within one standard error of the best (Breiman, Friedman, Olshen, Stone 1984,
//! section 3.4.3); of those, one that is one-to-one over the image.

use depthcal_model::Camera;
use depthcal_model::chain::{POSE, Workspace};
use nalgebra::{DMatrix, DVector, Isometry3, Translation3};
use tracing::{info, warn};

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::lens_order::{BROWN_CONRADY, LensCandidate, LensChoice, LensOrder};
use super::rules::Rules;
use super::settle::settle;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::blocks::is_depth_only;
use crate::adjust::frame_information::Curvature;
use crate::adjust::smoothness_selection::{FrameInformation, errors_worse, solve_scaled};
use crate::adjust::state::{CameraState, State};
use crate::observe::PosedFrame;

/// Standard deviation, px, of the place at which a ray meets the corners or edges of the image, up to which the markers
/// determine the lens there.
pub(super) const DETERMINED_PX: f64 = 2.0;
/// Parts of the cross-validation.
const MOST_FOLDS: usize = 10;
/// Standard errors by which an order may be worse than the best and still be chosen for being simpler.
const EQUAL_STANDARD_ERRORS: f64 = 1.0;
/// … and the rise of the cost of all left-out frames up to which it may: one standard deviation of what is left out. Where the
/// information on a term is in one frame alone, the standard error over frames is as large as the difference itself.
const MOST_COST: f64 = 0.5;
/// Depth at which rays are cast, mm; the lens does not depend on it unless it breathes.
const RAY_DEPTH_MM: f64 = 1000.0;

/// Settles a calibration from images; where the markers do not determine its lens over the whole image, with a lower order.
pub(super) fn settle_with_chosen_lens(
    start: &CameraState<PosedFrame>,
    rules: &Rules<'_, PosedFrame>,
    options: &CameraOptions,
) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
    let orders = distinct_orders(&start.camera);
    // The highest order that can be fitted at all.
    let mut place = orders.len();
    let fit = loop {
        place -= 1;
        let camera = orders[place].of_camera(&start.camera);
        match settle(State::of_camera(CameraState { camera, ..start.clone() }), rules, options) {
            Ok(fit) => break fit.only_camera(options),
            Err(error) if error.is_untrusted_fit() && place > 0 => info!("lens {}: {error}", orders[place]),
            Err(error) => return Err(error),
        }
    };
    let uncertain_px = corner_deviation_px(&fit);
    if place == 0 || (place + 1 == orders.len() && uncertain_px <= DETERMINED_PX) {
        return Ok(CalibratedCamera { lens_choice: None, ..fit });
    }
    let compared = compare_orders(&fit, &orders[..=place]);
    let chosen = choose(&compared);
    let candidates = compared.iter().map(|c| c.candidate).collect();
    let choice = Some(LensChoice { order: orders[chosen], candidates });
    let uncertain = match uncertain_px {
        px if px.is_finite() => format!("uncertain by {px:.1} px at the border of the image"),
        _ => "undetermined at the border of the image".to_owned(),
    };
    info!("the markers leave the lens {uncertain}; {}", choice.iter().map(LensChoice::to_string).collect::<String>());
    if !compared[chosen].candidate.one_to_one {
        warn!(
            "the lens {} is not one-to-one over the whole image, nor is any that predicts the markers as well",
            orders[chosen]
        );
    }
    if chosen == place {
        return Ok(CalibratedCamera { lens_choice: choice, ..fit });
    }
    let camera = orders[chosen].of_camera(&compared[chosen].camera);
    let lower =
        CameraState { prior: start.prior.clone(), ..CameraState::reference(fit.capture.clone(), camera, fit.noise) };
    match settle(State::of_camera(lower), rules, options) {
        Ok(lower) => Ok(CalibratedCamera { lens_choice: choice, ..lower.only_camera(options) }),
        Err(error) => {
            warn!("lens {}: {error}; {} is fitted", orders[chosen], orders[place]);
            Ok(CalibratedCamera { lens_choice: None, ..fit })
        }
    }
}

/// Orders that differ in what they leave free of a camera's lens, the simplest first.
fn distinct_orders(camera: &Camera) -> Vec<LensOrder> {
    let free = |order: &LensOrder| order.of_camera(camera).block(BROWN_CONRADY).map(|b| b.free.clone());
    let mut orders: Vec<LensOrder> = Vec::new();
    for order in LensOrder::ALL.into_iter().rev() {
        match orders.last_mut() {
            // Of two that do the same the lower name tells what is fitted.
            Some(last) if free(last) == free(&order) => *last = order,
            _ => orders.push(order),
        }
    }
    orders.reverse();
    orders
}

/// Corners and middles of the edges of a camera's image, px.
fn border(camera: &Camera) -> impl Iterator<Item = [f64; 2]> {
    let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    let steps = [0.0, 0.5, 1.0];
    let all = steps.into_iter().flat_map(move |v| steps.map(|u| [u * right, v * bottom]));
    all.filter(move |p| *p != [0.5 * right, 0.5 * bottom])
}

/// Whether every corner and edge of the image has a ray.
pub(super) fn one_to_one(camera: &Camera) -> bool {
    border(camera).all(|pixel| camera.ray(pixel, 1.0 / RAY_DEPTH_MM).is_ok())
}

/// Largest standard deviation, over the border of the image, of the place at which a ray meets the image, px: from the joint
/// covariance of lens and pinhole. Infinite where the lens has no inverse there.
pub(super) fn corner_deviation_px(fit: &CalibratedCamera<PosedFrame>) -> f64 {
    let camera = fit.camera.filtered(|b| !is_depth_only(b));
    let rays: Result<Vec<[f64; 2]>, _> = border(&camera).map(|pixel| camera.ray(pixel, 1.0 / RAY_DEPTH_MM)).collect();
    let (Ok(rays), Some(covariance)) = (rays, &fit.covariance) else { return f64::INFINITY };
    let points: Vec<[f64; 2]> = rays.iter().map(|r| r.map(|x| x * RAY_DEPTH_MM)).collect();
    let chain = camera.chain();
    let parameters = chain.image_parameter_count();
    let mut pixels = vec![[0.0; 2]; points.len()];
    let mut jacobian = vec![0.0; 2 * points.len() * (POSE + parameters)];
    let facing = Isometry3::from_parts(Translation3::new(0.0, 0.0, RAY_DEPTH_MM), nalgebra::UnitQuaternion::identity());
    let mut work = Workspace::default();
    if chain.image(&mut work, &camera.theta(), &facing, &points, &mut pixels, Some(&mut jacobian)).is_err() {
        return f64::INFINITY;
    }
    let covariance = covariance.view((0, 0), (parameters, parameters));
    let variances = jacobian.chunks_exact(POSE + parameters).map(|row| {
        let row = DVector::from_column_slice(&row[POSE..]);
        row.dot(&(covariance * &row))
    });
    variances.fold(0.0, f64::max).sqrt()
}

/// An order with its camera, fitted to all frames, and the cost of every frame when it is left out.
struct Compared {
    candidate: LensCandidate,
    camera: Camera,
    costs: Vec<f64>,
}

/// The orders on left-out frames, by the adjustment linearised at the fit of the highest: the lens is linear in its parameters.
fn compare_orders(fit: &CalibratedCamera<PosedFrame>, orders: &[LensOrder]) -> Vec<Compared> {
    let adjustment = Adjustment::new(&fit.capture, &fit.camera, &fit.noise, false);
    let frames = adjustment.frame_information(Curvature::OfWeights);
    let present: Vec<f64> = (0..frames.len())
        .map(|i| adjustment.frame_rows(0, i).map_or(0.0, |rows| 0.5 * rows.residuals.norm_squared()))
        .collect();
    let markers: usize = fit.capture.frames.iter().map(|f| f.markers.len()).sum();
    orders
        .iter()
        .map(|order| {
            let step = Step::new(&fit.camera, *order);
            let folds = frames.len().clamp(1, MOST_FOLDS);
            let sum = |keep: &dyn Fn(usize) -> bool| {
                let n = step.held.len();
                let summed = frames.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, frame)| frame);
                step.solve(&FrameInformation::added((DMatrix::zeros(n, n), DVector::zeros(n)), summed))
            };
            let left_out: Vec<Option<DVector<f64>>> = (0..folds).map(|fold| sum(&|i| i % folds != fold)).collect();
            let cost = |(i, (f, present)): (usize, (&FrameInformation, &f64))| {
                left_out[i % folds]
                    .as_ref()
                    .map_or(f64::INFINITY, |d| present + f.fitted.1.dot(d) + 0.5 * d.dot(&(&f.fitted.0 * d)))
            };
            let costs: Vec<f64> = frames.iter().zip(&present).enumerate().map(cost).collect();
            let camera = sum(&|_| true).map_or_else(|| order.of_camera(&fit.camera), |d| step.apply(&fit.camera, &d));
            let held_out_px = fit.noise.pixel_sigma * (2.0 * costs.iter().sum::<f64>() / markers as f64).sqrt();
            let candidate = LensCandidate { order: *order, held_out_px, one_to_one: one_to_one(&camera) };
            Compared { candidate, camera, costs }
        })
        .collect()
}

/// The place of the simplest order that is as good as the best, of those that are one-to-one where there are any. A lens that
/// folds at the border is kept where every other predicts the markers worse: they are what was measured.
fn choose(compared: &[Compared]) -> usize {
    let error = |i: &usize| compared[*i].candidate.held_out_px;
    let Some(best) = (0..compared.len()).min_by(|a, b| error(a).total_cmp(&error(b))) else { return 0 };
    let as_good = |i: &usize| {
        let (best, tried) = (&compared[best].costs, &compared[*i].costs);
        errors_worse(best, tried) <= EQUAL_STANDARD_ERRORS
            && tried.iter().sum::<f64>() <= best.iter().sum::<f64>() + MOST_COST
    };
    let good: Vec<usize> = (0..compared.len()).filter(as_good).collect();
    let one_to_one = good.iter().find(|i| compared[**i].candidate.one_to_one);
    one_to_one.or(good.first()).copied().unwrap_or(best)
}

/// Changes of a camera's free parameters that bring its lens to an order: the terms beyond it go to zero.
struct Step {
    /// For every free parameter the change that is prescribed, if any.
    held: Vec<Option<f64>>,
}

impl Step {
    fn new(camera: &Camera, order: LensOrder) -> Self {
        let lower = order.of_camera(camera);
        let mut held = Vec::new();
        for (now, then) in camera.blocks().iter().zip(lower.blocks()) {
            for i in (0..now.theta.len()).filter(|i| now.free[*i]) {
                held.push((!then.free[i]).then(|| then.theta[i] - now.theta[i]));
            }
        }
        Self { held }
    }

    /// The change that minimises gᵀδ + ½ δᵀNδ with the prescribed components; `None` where N does not determine it.
    fn solve(&self, (normal, gradient): &(DMatrix<f64>, DVector<f64>)) -> Option<DVector<f64>> {
        let mut step = DVector::from_iterator(self.held.len(), self.held.iter().map(|h| h.unwrap_or(0.0)));
        let free: Vec<usize> = (0..self.held.len()).filter(|i| self.held[*i].is_none()).collect();
        let slope = gradient + normal * &step;
        let normal_of_free = DMatrix::from_fn(free.len(), free.len(), |i, j| normal[(free[i], free[j])]);
        let solved = solve_scaled(normal_of_free, &DVector::from_fn(free.len(), |i, _| -slope[free[i]]))?;
        free.iter().zip(solved.iter()).for_each(|(i, change)| step[*i] = *change);
        Some(step)
    }

    /// The camera after the change.
    fn apply(&self, camera: &Camera, step: &DVector<f64>) -> Camera {
        let mut changes = step.iter();
        camera.map_blocks(|mut block| {
            for i in 0..block.theta.len() {
                if block.free[i] {
                    block.theta[i] += changes.next().copied().unwrap_or(0.0);
                }
            }
            block
        })
    }
}
