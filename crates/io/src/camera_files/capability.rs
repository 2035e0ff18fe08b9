//! Cameras that a format can hold, and the nearest one where it cannot hold a camera.

use depthcal_model::{Camera, Register};
use nalgebra::Vector3;

use super::lens_form::{LensForm, form_of, lens_blocks, needed};
use super::outcome::ExportWarning;

/// A lens model of a format: a piece whose first `count` parameters it holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HeldLens {
    /// The format's name for it.
    pub name: &'static str,
    pub piece: &'static str,
    pub count: usize,
}

/// Pixels over the image at which cameras are compared, columns and rows.
const GRID: [usize; 2] = [41, 31];

/// The camera that is written: its pinhole without skew, its lens model in the format's terms, and the values of that.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Written {
    pub pinhole: [f64; 4],
    pub lens: HeldLens,
    pub values: Vec<f64>,
    pub warnings: Vec<ExportWarning>,
}

/// The camera in the first of a format's lens models that holds it exactly; where there is none, the nearest of all of them, with
/// the largest error that this makes.
pub(super) fn nearest(camera: &Camera, format: &'static str, models: &[HeldLens]) -> Written {
    let [fx, fy, cx, cy, skew] = camera.pinhole();
    let form = form_of(camera);
    let exact = form.and_then(|form| models.iter().find_map(|model| Some((*model, values_in(&form, model)?))));
    if let (Some((lens, values)), true) = (&exact, skew == 0.0) {
        return Written { pinhole: [fx, fy, cx, cy], lens: *lens, values: values.clone(), warnings: Vec::new() };
    }
    let (rays, pixels) = camera.rays_over_image(GRID[0], GRID[1]);
    let mut warnings = Vec::new();
    let missing = 1.0 - rays.len() as f64 / (GRID[0] * GRID[1]) as f64;
    if missing > 0.0 {
        warnings.push(ExportWarning::NoRays { share_percent: 100.0 * missing });
    }
    // Where only the skew is lost the lens stays of its kind.
    let only = exact.map(|(lens, _)| lens);
    let tried = models.iter().filter(|m| only.is_none_or(|only| **m == only));
    let fitted = tried.filter_map(|model| {
        let fitted = starting(camera, form.as_ref(), model)?.fitted_to_rays(&rays, &pixels);
        let error = largest_error(&fitted, &rays, &pixels);
        Some((*model, fitted, error))
    });
    let best = fitted.min_by(|a, b| a.2.total_cmp(&b.2));
    let Some((lens, fitted, largest_px)) = best else {
        let lens = models[0];
        return Written { pinhole: [fx, fy, cx, cy], lens, values: vec![0.0; lens.count], warnings };
    };
    let lost = lost(camera, form.as_ref(), models, skew);
    warnings.push(ExportWarning::Approximated { format, lost, written: lens.name, largest_px });
    let [fx, fy, cx, cy, _] = fitted.pinhole();
    let values = fitted.block(lens.piece).map_or_else(Vec::new, |b| b.theta[..lens.count].to_vec());
    Written { pinhole: [fx, fy, cx, cy], lens, values, warnings }
}

/// The values of a lens in the terms of a model, where it holds it exactly.
fn values_in(form: &LensForm, model: &HeldLens) -> Option<Vec<f64>> {
    let all: &[f64] = match (form, model.piece) {
        (LensForm::OpenCv(c), "brown_conrady" | "opencv_lens") => c,
        (LensForm::Fisheye(k), "kannala_brandt") => k,
        (LensForm::Unified(k), "unified") => k,
        (LensForm::Cahvor(k), "cahvor") => k,
        _ => return None,
    };
    (needed(all) <= model.count).then(|| all[..model.count.min(all.len())].to_vec())
}

/// The camera from which a fit of a lens model starts, its parameters free as far as the model has them.
fn starting(camera: &Camera, form: Option<&LensForm>, model: &HeldLens) -> Option<Camera> {
    let mut block = Register::builtin().block(model.piece, None).ok()?;
    block.free.iter_mut().skip(model.count).for_each(|free| *free = false);
    // What OpenCV's model has in common with the lens.
    if let (Some(LensForm::OpenCv(c)), "brown_conrady" | "opencv_lens") = (form, model.piece) {
        block.theta[..model.count].copy_from_slice(&c[..model.count]);
    }
    let [fx, fy, cx, cy, _] = camera.pinhole();
    Some(Camera::new(camera.width, camera.height, [fx, fy, cx, cy, 0.0], vec![block]))
}

/// Largest distance between pixels and the projections of their rays, px.
pub(super) fn largest_error(camera: &Camera, rays: &[[f64; 2]], pixels: &[[f64; 2]]) -> f64 {
    let error = |(ray, pixel): (&[f64; 2], &[f64; 2])| match camera.project(&Vector3::new(ray[0], ray[1], 1.0)) {
        Some([u, v]) => (u - pixel[0]).hypot(v - pixel[1]),
        None => f64::INFINITY,
    };
    rays.iter().zip(pixels).map(error).fold(0.0, f64::max)
}

/// Properties of a camera that a format with these lens models cannot hold, in words.
fn lost(camera: &Camera, form: Option<&LensForm>, models: &[HeldLens], skew: f64) -> Vec<String> {
    const NAMES: [&str; 14] =
        ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"];
    let mut lost = Vec::new();
    if skew != 0.0 {
        lost.push("skew".to_owned());
    }
    if form.is_some_and(|form| models.iter().any(|model| values_in(form, model).is_some())) {
        return lost;
    }
    let most = models.iter().filter(|m| matches!(m.piece, "brown_conrady" | "opencv_lens")).map(|m| m.count).max();
    match (form, most) {
        (Some(LensForm::OpenCv(c)), Some(most)) => {
            let beyond = NAMES.iter().zip(c).skip(most).filter(|(_, value)| **value != 0.0);
            lost.extend(beyond.map(|(name, _)| (*name).to_owned()));
        }
        _ => lost.extend(lens_blocks(camera).iter().map(|b| b.name().to_owned())),
    }
    lost
}
