//! Effects outside the catalogue, for tests of the verdict `unexplained`.

use rand::RngExt;
use rand_distr::StandardNormal;

use super::info::{Parameters, parameters};
use super::sizing::{Context, usual};
use crate::error::SimulateError;
use crate::instrument::{DepthEffect, Instrument, Reading, Stage, with_depth_added};
use crate::streams::{Purpose, stream};

/// A smooth random map over the image in ρ whose amplitude decays exponentially with disparity (as in Herrera, Kannala,
/// Heikkilä 2012).
struct SmoothMap {
    scale: f64,
    /// Amplitudes of cos(π i u) cos(π j v), u and v from 0 to 1 over the image.
    waves: Vec<(f64, f64, f64)>,
    size: [f64; 2],
    /// Disparity over which the amplitude falls to 1/e, px.
    decay: f64,
    disparity_scale: f64,
}

impl DepthEffect for SmoothMap {
    fn stage(&self) -> Stage {
        Stage::Disparity
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let (u, v) = (reading.pixel[0] / self.size[0], reading.pixel[1] / self.size[1]);
        let pi = std::f64::consts::PI;
        let map: f64 = self.waves.iter().map(|(i, j, a)| a * (pi * i * u).cos() * (pi * j * v).cos()).sum();
        rho + self.scale * map * (-rho * self.disparity_scale / self.decay).exp()
    }
}

pub(super) fn smooth_map(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let mut rng = context.unit_stream();
    // Constant, linear and second-order parts would resemble effects of the catalogue: only orders 3 to 5 are used.
    let orders = (0..=4u32).flat_map(|i| (0..=4u32).map(move |j| (i, j))).filter(|(i, j)| (3..=5).contains(&(i + j)));
    let waves: Vec<_> = orders
        .map(|(i, j)| (f64::from(i), f64::from(j), rng.sample::<f64, _>(StandardNormal) / f64::from(i + j)))
        .collect();
    let camera = context.camera;
    let map = |scale: f64| SmoothMap {
        scale,
        waves: waves.clone(),
        size: [camera.width as f64, camera.height as f64],
        decay: 60.0,
        disparity_scale: camera.disparity_scale(),
    };
    let scale = 1e-6 * size / context.rms_mm(&map(1e-6), usual());
    to.add(Box::new(map(scale)));
    Ok(parameters([("scale_per_mm", scale), ("decay_px", 60.0)]))
}

/// Blocks of rows, each with a readout bias of its own in ρ.
struct RowBanding {
    scale: f64,
    offsets: Vec<f64>,
    rows: f64,
}

impl DepthEffect for RowBanding {
    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let band = (reading.pixel[1].max(0.0) / self.rows) as usize;
        rho + self.scale * self.offsets[band % self.offsets.len()]
    }
}

pub(super) fn row_banding(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let mut rng = context.unit_stream();
    let rows = context.near(24.0, 8.0).round();
    let offsets: Vec<f64> = (0..64).map(|_| rng.sample(StandardNormal)).collect();
    let banding = |scale: f64| RowBanding { scale, offsets: offsets.clone(), rows };
    let scale = 1e-6 * size / context.rms_mm(&banding(1e-6), usual());
    to.add(Box::new(banding(scale)));
    Ok(parameters([("scale_per_mm", scale), ("rows_px", rows)]))
}

/// Two halves of the sensor with different offsets: left of a column, depth is too large by a constant.
struct EdgeStep {
    column: f64,
    step: f64,
}

impl DepthEffect for EdgeStep {
    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        if reading.pixel[0] < self.column { with_depth_added(rho, self.step) } else { rho }
    }
}

pub(super) fn edge_step(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let column = (context.near(0.45, 0.15) * context.camera.width as f64).round();
    to.add(Box::new(EdgeStep { column, step: size }));
    Ok(parameters([("column_px", column), ("step_mm", size)]))
}

/// Multipath via a wall near one corner of the field of view: depth there is too large, in proportion to depth.
struct MultipathCorner {
    size: f64,
    corner: [f64; 2],
    reach: f64,
}

impl DepthEffect for MultipathCorner {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let distance = (reading.pixel[0] - self.corner[0]).hypot(reading.pixel[1] - self.corner[1]);
        let z = 1.0 / rho;
        with_depth_added(rho, self.size * z / 800.0 * (-distance / self.reach).exp())
    }
}

pub(super) fn multipath_corner(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let (width, height) = (context.camera.width as f64, context.camera.height as f64);
    let right = context.near(0.6, 0.6) > 0.5;
    let lower = context.near(0.6, 0.6) > 0.5;
    let corner = [if right { width - 1.0 } else { 0.0 }, if lower { height - 1.0 } else { 0.0 }];
    let reach = context.near(0.3, 0.08) * width;
    to.add(Box::new(MultipathCorner { size, corner, reach }));
    Ok(parameters([("corner_u_px", corner[0]), ("corner_v_px", corner[1]), ("reach_px", reach), ("peak_mm", size)]))
}

/// A plane of its own added in ρ to some of the frames, as if the projector had moved.
struct TiltedFrames {
    scale: f64,
    /// Plane a + b x + c y of every frame; zeros where nothing happened.
    planes: Vec<[f64; 3]>,
}

impl DepthEffect for TiltedFrames {
    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let [a, b, c] = self.planes[reading.conditions.frame % self.planes.len()];
        rho + self.scale * (a + b * reading.ray[0] + c * reading.ray[1])
    }
}

pub(super) fn tilted_frames(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let mut rng = stream(context.seed, Purpose::EffectFrames, 0);
    let mut plane = |_| {
        let hit = rng.random_bool(0.3);
        let values: [f64; 3] = std::array::from_fn(|_| rng.sample(StandardNormal));
        if hit { [0.5 * values[0], 2.0 * values[1], 2.0 * values[2]] } else { [0.0; 3] }
    };
    let planes: Vec<[f64; 3]> = (0..1024).map(&mut plane).collect();
    // The size is that of a typical affected frame: each coefficient of the plane at one standard deviation.
    let one = |part: usize| {
        let mut plane = [0.0; 3];
        plane[part] = if part == 0 { 0.5 } else { 2.0 };
        context.rms_mm(&TiltedFrames { scale: 1e-6, planes: vec![plane] }, usual())
    };
    let rms = (0..3).map(|part| one(part).powi(2)).sum::<f64>().sqrt();
    let scale = 1e-6 * size / rms;
    to.add(Box::new(TiltedFrames { scale, planes }));
    Ok(parameters([("scale_per_mm", scale), ("share_of_frames", 0.3)]))
}

/// Glare inside the lens pulls the measured depth towards that of the surroundings. The error depends jointly on
/// depth and on the radius in the image.
struct LensGlare {
    strength: f64,
    ambient: f64,
}

impl DepthEffect for LensGlare {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let z = 1.0 / rho;
        let r2 = reading.ray[0] * reading.ray[0] + reading.ray[1] * reading.ray[1];
        // The share of glare grows as the surface's own light falls with the squared depth.
        let share = self.strength * (z / 1000.0).powi(2) * (-r2 / 0.08).exp();
        with_depth_added(rho, share * (self.ambient - z))
    }
}

pub(super) fn lens_glare(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let ambient = context.near(450.0, 80.0);
    let glare = |strength: f64| LensGlare { strength, ambient };
    let strength = 1e-3 * size / context.rms_mm(&glare(1e-3), usual());
    to.add(Box::new(glare(strength)));
    Ok(parameters([("strength", strength), ("ambient_mm", ambient)]))
}
