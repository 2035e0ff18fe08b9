//! Observations without images: marker positions and depth samples with white noise, for statistical tests.

use std::collections::HashSet;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use crate::board::Pattern;
use crate::conditions::Conditions;
use crate::defects::Frame;
use crate::error::{SimulateError, not_negative};
use crate::noise::UnitNoise;
use crate::session::{Session, frame_name};
use crate::simulation::Simulation;
use crate::streams::{Purpose, stream};
use crate::truth::Truth;

/// Options of point observations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PointOptions {
    /// Standard deviation of marker positions, px per axis.
    pub sigma_px: f64,
    /// Number of depth samples per frame, on distinct pixels, uniformly over the rectangle of the markers.
    pub depth_samples: usize,
    /// Least distance of samples from the edges of the print, mm.
    pub edge_margin_mm: f64,
    /// Whether dots are sampled as well. The dark squares of a chessboard always are.
    pub on_dots: bool,
    /// Standard deviation of the depth at markers relative to that of a pixel. It is below 1 as depth at a marker is
    /// fitted to many pixels.
    pub marker_depth_share: f64,
}

impl Default for PointOptions {
    fn default() -> Self {
        Self { sigma_px: 0.05, depth_samples: 500, edge_margin_mm: 1.5, on_dots: false, marker_depth_share: 0.3 }
    }
}

/// Point observations of a capture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointObservations {
    /// The frames in capture order.
    pub frames: Vec<FramePoints>,
    /// The truth.
    pub truth: Truth,
}

/// One frame of [`PointObservations`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FramePoints {
    /// Name of the frame.
    pub name: String,
    /// Time and temperature.
    pub conditions: Conditions,
    /// Markers within the image.
    pub markers: Vec<MarkerPoint>,
    /// Depth samples on the board.
    pub depths: Vec<DepthSample>,
}

/// A marker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MarkerPoint {
    /// Its index on the board.
    pub index: usize,
    /// Its measured position [u, v], px.
    pub pixel: [f64; 2],
    /// Standard deviation per axis, px.
    pub sigma_px: f64,
    /// Depth measured there, with the reflectance of paper instead of the marker's, mm; `None` when the depth image
    /// misses the board.
    pub z_mm: Option<f64>,
    /// Standard deviation of the inverse of that depth, 1/mm.
    pub sigma_rho: f64,
}

/// A depth pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthSample {
    /// The pixel [u, v], integers.
    pub pixel: [f64; 2],
    /// Its measured depth, mm.
    pub z_mm: f64,
    /// Standard deviation of the inverse of that depth, 1/mm.
    pub sigma_rho: f64,
    /// Infrared signal there without noise, share of full scale.
    pub amplitude: f64,
}

impl Simulation {
    /// Markers and depth samples of every frame with white noise, without rendering and without quantisation.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable.
    pub fn observe_points(&self, options: &PointOptions) -> Result<PointObservations, SimulateError> {
        not_negative([
            ("sigma_px", options.sigma_px),
            ("edge_margin_mm", options.edge_margin_mm),
            ("marker_depth_share", options.marker_depth_share),
        ])?;
        let session = Session::new(self)?;
        let frames = session
            .frames
            .iter()
            .enumerate()
            .map(|(i, frame)| FramePoints {
                name: frame_name(i),
                conditions: frame.declared,
                markers: markers(&session, frame, options),
                depths: depths(&session, frame, options),
            })
            .collect();
        Ok(PointObservations { frames, truth: session.truth })
    }
}

fn markers(session: &Session<'_>, frame: &Frame, options: &PointOptions) -> Vec<MarkerPoint> {
    let simulation = session.simulation;
    let noise = simulation.noise.unit();
    let mut rng = stream(session.seed(), Purpose::PointMarkers, frame.image.source);
    let shown = session.placed(&frame.image);
    let measured = session.placed(&frame.depth);
    let light = session.light(&frame.depth);
    let (width, height) = (simulation.camera.width as f64, simulation.camera.height as f64);
    let marker = |index: usize| {
        let [u, v] = session.instrument.optics.project(shown.point(simulation.board.marker(index)))?;
        if !(u >= 0.0 && v >= 0.0 && u <= width - 1.0 && v <= height - 1.0) {
            return None;
        }
        let mut pixel = [u + options.sigma_px * noise.draw(&mut rng), v + options.sigma_px * noise.draw(&mut rng)];
        let (strike, far, angle) = (rng.random::<f64>(), rng.random_range(2.0..20.0), rng.random_range(0.0..6.3f64));
        if strike < simulation.defects.marker_outliers {
            pixel = [pixel[0] + far * angle.cos(), pixel[1] + far * angle.sin()];
        }
        let standard = noise.draw(&mut rng);
        let rho = session.depth_point(&measured, &light, &frame.depth, [u, v], true).map(|point| point.rho);
        let sigma_rho = options.marker_depth_share * simulation.noise.depth.sigma_rho(rho.unwrap_or(0.001));
        let z_mm = rho.map(|rho| simulation.defects.depth_unit_factor / (rho + sigma_rho * standard));
        Some(MarkerPoint { index, pixel, sigma_px: options.sigma_px, z_mm, sigma_rho })
    };
    (0..simulation.board.len()).filter_map(marker).collect()
}

fn depths(session: &Session<'_>, frame: &Frame, options: &PointOptions) -> Vec<DepthSample> {
    let simulation = session.simulation;
    let board = &simulation.board;
    let noise = simulation.noise.unit();
    let mut rng = stream(session.seed(), Purpose::PointDepths, frame.depth.source);
    // A stream of its own, so that the pixels do not depend on the noise.
    let mut errors = stream(session.seed(), Purpose::PointNoise, frame.depth.source);
    let placed = session.placed(&frame.depth);
    let light = session.light(&frame.depth);
    let [x0, y0, x1, y1] = board.marker_rectangle();
    let (width, height) = (simulation.camera.width as f64, simulation.camera.height as f64);
    let [du, dv] = session.instrument.registration;
    let mut taken = HashSet::new();
    let mut samples = Vec::with_capacity(options.depth_samples);
    for _ in 0..20 * options.depth_samples {
        if samples.len() == options.depth_samples {
            break;
        }
        let aim = [x0 + (x1 - x0) * rng.random::<f64>(), y0 + (y1 - y0) * rng.random::<f64>()];
        let Some([u, v]) = session.instrument.optics.project(placed.point(aim)) else { continue };
        let pixel = [(u + du).round(), (v + dv).round()];
        let inside = pixel[0] >= 0.0 && pixel[1] >= 0.0 && pixel[0] < width && pixel[1] < height;
        if !inside || !taken.insert([pixel[0] as i64, pixel[1] as i64]) {
            continue;
        }
        let Some(point) = session.depth_point(&placed, &light, &frame.depth, pixel, false) else { continue };
        let surface = board.surface(point.cut.design);
        let on_dot = surface.printed && !matches!(board.pattern, Pattern::Chessboard);
        let [x, y] = point.cut.design;
        let within = x >= x0 && x <= x1 && y >= y0 && y <= y1;
        if !within || surface.print_edge_mm < options.edge_margin_mm || (on_dot && !options.on_dots) {
            continue;
        }
        let sigma_rho = simulation.noise.depth.sigma_rho(point.rho);
        let z = observed(simulation, point.rho, sigma_rho, &noise, &mut errors);
        samples.push(DepthSample { pixel, z_mm: z, sigma_rho, amplitude: point.amplitude });
    }
    samples
}

/// Depth with noise, sometimes an outlier, in the declared unit.
fn observed(simulation: &Simulation, rho: f64, sigma: f64, noise: &UnitNoise, rng: &mut impl Rng) -> f64 {
    let mut z = 1.0 / (rho + sigma * noise.draw(rng));
    let (strike, far, nearer) = (rng.random::<f64>(), rng.random_range(20.0..200.0), rng.random_bool(0.5));
    if strike < simulation.defects.depth_outliers {
        z += if nearer { -far } else { far };
    }
    z * simulation.defects.depth_unit_factor
}
