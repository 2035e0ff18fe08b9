//! Effects on the lens: thin prism, rational radial distortion, a tilted sensor, focus breathing.

use nalgebra::{DMatrix, DVector};

use super::info::{Parameters, parameters};
use super::sizing::Context;
use crate::error::SimulateError;
use crate::instrument::Instrument;
use crate::optics::Optics;

/// Decentred elements: Δx = s1 r² + s2 r⁴, Δy = s3 r² + s4 r⁴.
pub(super) fn thin_prism(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let form = [context.near(1.0, 0.5), context.near(-0.4, 0.4), context.near(-0.6, 0.5), context.near(0.5, 0.4)];
    let prism = |scale: f64| {
        let mut optics = Optics::new(context.camera);
        optics.prism = form.map(|s| s * scale);
        optics
    };
    let scale = scaled(context, "thin_prism", size, 1e-4, prism)?;
    to.optics.prism = form.map(|s| s * scale);
    let [s1, s2, s3, s4] = to.optics.prism;
    Ok(parameters([("s1", s1), ("s2", s2), ("s3", s3), ("s4", s4)]))
}

/// A sensor that is not perpendicular to the optical axis.
pub(super) fn tilted_sensor(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let angle = context.near(40.0, 180.0).to_radians();
    let tilt = |scale: f64| [scale * angle.cos(), scale * angle.sin()];
    let tilted = |scale: f64| {
        let mut optics = Optics::new(context.camera);
        optics.set_tilt(tilt(scale));
        optics
    };
    let scale = scaled(context, "tilted_sensor", size, 1e-3, tilted)?;
    let [x, y] = tilt(scale);
    to.optics.set_tilt([x, y]);
    Ok(parameters([("tau_x_rad", x), ("tau_y_rad", y)]))
}

/// A focal length that changes linearly with inverse depth.
pub(super) fn focus_breathing(_: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    const RADIUS_PX: f64 = 240.0;
    let growth = size / RADIUS_PX / (1.0 / 500.0 - 1.0 / 1000.0);
    // Beyond a change of the focal length by a tenth at the nearest distances the linear form is meaningless.
    if growth.abs() > 50.0 {
        let reason = "the focal length would change by more than a tenth";
        return Err(SimulateError::EffectTooLarge { name: "focus_breathing", size, unit: "px", reason });
    }
    to.optics.breathing_mm = growth;
    Ok(parameters([("growth_mm", growth), ("focused_at_mm", 1.0 / crate::optics::FOCUSED_AT)]))
}

/// A radial distortion that no polynomial of three terms represents. As in calibrations of real wide-angle lenses,
/// numerator and denominator largely cancel; the size is that of the remainder.
pub(super) fn rational_distortion(
    context: &Context,
    size: f64,
    to: &mut Instrument,
) -> Result<Parameters, SimulateError> {
    let form = [context.near(-1.0, 0.1), context.near(1.0, 0.2), context.near(1.0, 0.2)];
    let base = Optics::new(context.camera);
    let scaled_lens = |scale: f64| rational(context, &base, form.map(|k| k * scale));
    let wanted = size.abs();
    // The remainder grows with the scale until the denominator approaches zero.
    let (mut low, mut high) = (0.0, 0.05);
    while context.rms_px(&base, &scaled_lens(high)) < wanted {
        (low, high) = (high, high * 1.1);
        if !usable(context, &base, &scaled_lens(high)) {
            let reason = "the lens would fold inside the image";
            return Err(SimulateError::EffectTooLarge { name: "rational_distortion", size, unit: "px", reason });
        }
    }
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        if context.rms_px(&base, &scaled_lens(middle)) < wanted { low = middle } else { high = middle }
    }
    let lens = scaled_lens(high);
    to.optics.radial = lens.radial;
    to.optics.denominator = lens.denominator;
    let ([k1, k2, k3], [k4, k5, k6]) = (lens.radial, lens.denominator);
    Ok(parameters([("k1", k1), ("k2", k2), ("k3", k3), ("k4", k4), ("k5", k5), ("k6", k6)]))
}

/// Whether the lens projects every ray that `base` projects, with a denominator well above zero.
fn usable(context: &Context, base: &Optics, lens: &Optics) -> bool {
    let rays: Vec<[f64; 2]> =
        context.pixel_grid().into_iter().filter_map(|pixel| base.ray(pixel, crate::optics::FOCUSED_AT)).collect();
    let [k4, k5, k6] = lens.denominator;
    rays.iter().all(|[x, y]| {
        let s = x * x + y * y;
        1.0 + s * (k4 + s * (k5 + s * k6)) > 0.1 && lens.project([*x, *y, 1.0]).is_some()
    })
}

/// The lens with this denominator, and the numerator with which it is closest to `base` over the image.
fn rational(context: &Context, base: &Optics, denominator: [f64; 3]) -> Optics {
    let radii: Vec<f64> = context
        .pixel_grid()
        .into_iter()
        .filter_map(|pixel| base.ray(pixel, 0.001))
        .map(|[x, y]| x * x + y * y)
        .collect();
    let series = |[a, b, c]: [f64; 3], s: f64| 1.0 + s * (a + s * (b + s * c));
    // r (1 + k1 s + k2 s² + k3 s³) / d(s) as close as possible to r n(s), s = r².
    let weight = |s: f64| s.sqrt() / series(denominator, s);
    let rows = DMatrix::from_fn(radii.len(), 3, |i, j| weight(radii[i]) * radii[i].powi(j as i32 + 1));
    let wanted = DVector::from_fn(radii.len(), |i, _| {
        let s = radii[i];
        s.sqrt() * series(base.radial, s) - weight(s)
    });
    let mut optics = base.clone();
    if let Ok(solution) = rows.svd(true, true).solve(&wanted, 1e-12) {
        optics.radial = [solution[0], solution[1], solution[2]];
        optics.denominator = denominator;
    }
    optics
}

/// The scale at which `of` displaces the image by `size` px rms, by fixed-point iteration: the displacement is nearly
/// linear in the scale.
fn scaled(
    context: &Context,
    name: &'static str,
    size: f64,
    start: f64,
    optics: impl Fn(f64) -> Optics,
) -> Result<f64, SimulateError> {
    if size == 0.0 {
        return Ok(0.0);
    }
    let base = Optics::new(context.camera);
    let mut scale = start * size.signum();
    for _ in 0..8 {
        let rms = context.rms_px(&base, &optics(scale));
        if !(rms.is_finite() && rms > 0.0 && scale.abs() < 1.0) {
            return Err(SimulateError::EffectTooLarge { name, size, unit: "px", reason: "the image would fold" });
        }
        scale *= size.abs() / rms;
    }
    Ok(scale)
}
