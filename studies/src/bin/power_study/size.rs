//! How well a fitted effect is the true one. What an effect shares with the camera's other parameters is no matter of the
//! effect (a displacement that the focal length takes up, a bias that D takes up): both are compared in the part that the
//! others cannot make.

use depthcal::calibration::calibrate::CalibratedCamera;
use depthcal::calibration::simulated;
use depthcal::model::Context;
use depthcal::model::hook::HookKind;
use depthcal_simulate::{
    CameraTruth, DepthNoise, Effect, EffectTruth, Kind, Noise, PointObservations, PointOptions, Simulation,
};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::Failure;

/// A fitted effect against the true one.
#[derive(Debug, Clone, Copy)]
pub struct Recovery {
    /// Root mean square of the fitted over that of the true one.
    pub ratio: f64,
    /// Root mean square of their difference over that of the true one.
    pub deviation: f64,
}

impl Recovery {
    /// Of two vectors in the part that the columns of `others` cannot make.
    fn of(fitted: &DVector<f64>, truth: &DVector<f64>, others: DMatrix<f64>) -> Self {
        let q = others.qr().q();
        let remainder = |v: &DVector<f64>| v - &q * (q.transpose() * v);
        let (fitted, truth) = (remainder(fitted), remainder(truth));
        Self { ratio: fitted.norm() / truth.norm(), deviation: (&fitted - &truth).norm() / truth.norm() }
    }
}

/// The capture without noise, by a camera without D.
fn exact(simulation: &Simulation, effects: &[Effect]) -> Result<PointObservations, Failure> {
    let truth = simulation.truth()?;
    let camera = CameraTruth { depth: [0.0, 0.0, 0.0, 1.0], ..truth.camera };
    let noise = Noise { depth: DepthNoise::Disparity { sigma_rho: 0.0 }, ..Noise::default() };
    let points = PointOptions { sigma_px: 0.0, ..PointOptions::default() };
    Ok(Simulation::new(camera, Kind::General(1), effects, truth.seed)
        .unit(truth.unit)
        .noise(noise)
        .observe_points(&points)?)
}

/// Compares the effect in a fit with the simulated one.
/// Amplitudes of the fit are `full_scale` times the simulator's.
pub fn recovery(
    simulation: &Simulation,
    fit: &CalibratedCamera,
    truth: &EffectTruth,
    full_scale: f64,
) -> Result<Option<Recovery>, Failure> {
    let Some(block) = fit.camera.block(&truth.name) else { return Ok(None) };
    let value = |key: &str| truth.parameters.get(key).copied().unwrap_or(f64::NAN);
    let ratio = |fitted: f64, truth: f64| {
        Some(Recovery { ratio: (fitted / truth).abs(), deviation: (fitted - truth).abs() / truth.abs() })
    };
    match truth.name.as_str() {
        "print_scale" => return Ok(ratio(block.theta[0], value("stretch"))),
        "depth_registration" => return Ok(ratio(block.theta[0].hypot(block.theta[1]), truth.size)),
        "board_bow" => return Ok(Some(bow(fit, &block.theta, ["a_mm", "b_mm", "c_mm"].map(value)))),
        "board_warp" => {
            return Ok(Some(warp(fit, ["x_mm", "x_radians", "y_mm", "y_radians"].map(value))));
        }
        _ => {}
    }
    let with = exact(simulation, &[Effect::new(&truth.name, truth.size)?])?;
    let without = exact(simulation, &[])?;
    let is_lens = block.hook() == HookKind::Lens;
    Ok(Some(if is_lens {
        lens(fit, &truth.name, &with, &without)?
    } else {
        depth(fit, &truth.name, &with, &without, full_scale)?
    }))
}

/// Heights over the markers; poses take up planes.
fn bow(fit: &CalibratedCamera, theta: &[f64], [a, b, c]: [f64; 3]) -> Recovery {
    let points = fit.capture.target.points();
    let span = |k: usize| {
        let extreme = |pick: fn(f64, f64) -> f64, start: f64| points.iter().map(|p| p[k]).fold(start, pick);
        let (low, high) = (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY));
        (0.5 * (low + high), 0.5 * (high - low))
    };
    let ((x0, wx), (y0, wy)) = (span(0), span(1));
    let fitted = DVector::from_iterator(
        points.len(),
        points.iter().map(|[x, y]| theta[0] * x * x + theta[1] * x * y + theta[2] * y * y),
    );
    let heights = points.iter().map(|[x, y]| {
        let (xi, eta) = ((x - x0) / wx, (y - y0) / wy);
        a * xi * xi + b * eta * eta + c * xi * eta
    });
    let truth = DVector::from_iterator(points.len(), heights);
    let plane = DMatrix::from_fn(points.len(), 3, |i, k| [1.0, points[i][0], points[i][1]][k]);
    Recovery::of(&fitted, &truth, plane)
}

/// Heights over the markers, of the piece and of the simulated waves; poses and a bow take up terms of second degree.
fn warp(fit: &CalibratedCamera, [x_mm, x_radians, y_mm, y_radians]: [f64; 4]) -> Recovery {
    let points = fit.capture.target.points();
    let [low, high] = fit.capture.target.marker_rectangle();
    let place = |p: &[f64; 2]| [0, 1].map(|i| (2.0 * p[i] - low[i] - high[i]) / (high[i] - low[i]));
    let camera = fit.camera.filtered(|b| b.name() == "board_warp");
    let fitted = DVector::from_iterator(points.len(), points.iter().map(|p| camera.board_point(*p)[2]));
    let wave = |[x, y]: [f64; 2]| x_mm * (x_radians * x).sin() + y_mm * (y_radians * y).sin();
    let truth = DVector::from_iterator(points.len(), points.iter().map(|p| wave(place(p))));
    let others = DMatrix::from_fn(points.len(), 6, |i, k| {
        let [x, y] = place(&points[i]);
        [1.0, x, y, x * x, x * y, y * y][k]
    });
    Recovery::of(&fitted, &truth, others)
}

/// Inverse depth at the same pixels; D takes up what is affine in x, y and ρ.
fn depth(
    fit: &CalibratedCamera,
    name: &str,
    with: &PointObservations,
    without: &PointObservations,
    full_scale: f64,
) -> Result<Recovery, Failure> {
    let block = fit.camera.block(name).ok_or("not fitted")?;
    let piece = block.piece().ok_or("no piece")?;
    let bare = fit.camera.filtered(|b| b.name() != name && b.name() != "projective");
    let mut contexts = simulated::capture(with);
    contexts.frames.iter_mut().flat_map(|f| f.depth_pixels_mut()).for_each(|s| s.context.amplitude *= full_scale);
    let mut states: Vec<[f64; 4]> = Vec::new();
    let mut pixels: Vec<Context> = Vec::new();
    let mut truth = Vec::new();
    for ((a, b), frame) in with.frames.iter().zip(&without.frames).zip(&contexts.frames) {
        let mut pairs = Vec::new();
        for (sample, context) in a.depths.iter().zip(frame.depth_pixels()) {
            let Some(twin) = b.depths.iter().find(|d| d.pixel == sample.pixel) else { continue };
            let rho = 1.0 / twin.z_mm;
            let Ok([x, y]) = bare.ray(sample.pixel, rho) else { continue };
            pairs.push((Vector3::new(x, y, 1.0) * twin.z_mm, 1.0 / sample.z_mm - rho, context.context));
        }
        let Some(normal) = normal(&pairs.iter().map(|p| p.0).collect::<Vec<_>>()) else { continue };
        for (point, change, context) in pairs {
            let cosine = (normal.dot(&point) / point.norm()).abs();
            states.push([point.x / point.z, point.y / point.z, 1.0 / point.z, cosine]);
            pixels.push(context);
            truth.push(change);
        }
    }
    let mut out = vec![0.0; states.len()];
    piece.evaluate(&block.theta, states.as_flattened(), &pixels, &mut out);
    let fitted = DVector::from_iterator(states.len(), out.iter().zip(&states).map(|(o, s)| o - s[2]));
    let others = DMatrix::from_fn(states.len(), 4, |i, k| [1.0, states[i][0], states[i][1], 1000.0 * states[i][2]][k]);
    Ok(Recovery::of(&fitted, &DVector::from_vec(truth), others))
}

/// Normal of the plane through points.
fn normal(points: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    if points.len() < 3 {
        return None;
    }
    let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let scatter: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let least = (0..3).min_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]))?;
    Some(eigen.eigenvectors.column(least).into_owned())
}

/// Positions of the markers in the image; K and the five coefficients of the lens take up their share.
fn lens(
    fit: &CalibratedCamera,
    name: &str,
    with: &PointObservations,
    without: &PointObservations,
) -> Result<Recovery, Failure> {
    let block = fit.camera.block(name).ok_or("not fitted")?;
    let piece = block.piece().ok_or("no piece")?;
    let [fx, fy, cx, cy, _] = fit.camera.pinhole();
    let (mut states, mut truth) = (Vec::new(), Vec::new());
    for (a, b) in with.frames.iter().zip(&without.frames) {
        for marker in &a.markers {
            let Some(twin) = b.markers.iter().find(|m| m.index == marker.index) else { continue };
            let Some(z) = twin.z_mm else { continue };
            let (x, y) = ((twin.pixel[0] - cx) / fx, (twin.pixel[1] - cy) / fy);
            states.push([x, y, 1.0 / z, x, y]);
            truth.extend([(marker.pixel[0] - twin.pixel[0]) / fx, (marker.pixel[1] - twin.pixel[1]) / fy]);
        }
    }
    let run = |theta: &[f64]| {
        let mut out = vec![0.0; 2 * states.len()];
        piece.evaluate(theta, states.as_flattened(), &vec![Context::default(); states.len()], &mut out);
        DVector::from_vec(out)
    };
    let nominal: Vec<f64> = block.parameters().iter().map(|p| p.nominal).collect();
    let fitted = run(&block.theta) - run(&nominal);
    let others = DMatrix::from_fn(truth.len(), 9, |i, k| {
        let [x, y, ..] = states[i / 2];
        let r2 = x * x + y * y;
        let (along, of_x) = (if i % 2 == 0 { x } else { y }, i % 2 == 0);
        let columns = [
            f64::from(u8::from(of_x)),
            f64::from(u8::from(!of_x)),
            if of_x { x } else { 0.0 },
            if of_x { 0.0 } else { y },
            along * r2,
            along * r2 * r2,
            along * r2 * r2 * r2,
            if of_x { 2.0 * x * y } else { r2 + 2.0 * y * y },
            if of_x { r2 + 2.0 * x * x } else { 2.0 * x * y },
        ];
        columns[k]
    });
    Ok(Recovery::of(&fitted, &DVector::from_vec(truth), others))
}
