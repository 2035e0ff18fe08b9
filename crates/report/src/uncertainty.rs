//! Uncertainty of corrected depth: the covariance of the parameters propagated through the correction.

use depthcal_model::{Context, Quantities};
use nalgebra::DMatrix;
use rayon::prelude::*;

use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::depth_uncertainty::uncertain_depth_of;
use depthcal_statistics::quantile;

/// With more parameters than this, maps and curves have fewer points.
const MANY: usize = 60;

/// Standard deviations of corrected depth.
#[derive(Debug, Clone)]
pub(super) struct Uncertainty {
    /// Distances of the maps, mm: near, median and far of the fitted boards.
    pub distances: Vec<f64>,
    /// Columns and rows of the maps.
    pub grid: [usize; 2],
    /// Standard deviation at each cell of each map, mm; NaN where depth cannot be corrected.
    pub maps: Vec<Vec<f64>>,
    /// Distances of the curves, mm.
    pub curve_at: Vec<f64>,
    /// Standard deviation in the middle, half way out and in the corner of the image, mm.
    pub curves: [Vec<f64>; 3],
    /// Nearest and farthest distance of the fitted samples, mm.
    pub covered: [f64; 2],
}

/// Distances (mm) of the fitted depth samples, else of the boards.
pub(super) fn distances(c: &CalibratedCamera) -> Vec<f64> {
    let samples: Vec<f64> = c.capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| s.depth_mm)).collect();
    if samples.is_empty() { c.capture.poses().map(|p| p.translation.vector.z).collect() } else { samples }
}

/// A pixel under the median conditions of the fit: amplitude, time and temperature.
pub(super) fn typical(c: &CalibratedCamera, pixel: [f64; 2]) -> Context {
    let contexts = || c.capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| s.context));
    Context {
        pixel,
        amplitude: quantile(contexts().map(|c| c.amplitude), 0.5),
        time_s: quantile(c.capture.frames.iter().map(|f| f.time_s), 0.5),
        temperature_c: quantile(c.capture.frames.iter().map(|f| f.temperature_c), 0.5),
        quantities: Quantities::summarized(c.capture.frames.iter().map(|f| &f.quantities), |values| {
            quantile(values, 0.5)
        }),
        ..Context::default()
    }
}

impl Uncertainty {
    /// Maps and curves; `None` where the calibration has no depth or no covariance.
    pub(super) fn of(c: &CalibratedCamera) -> Option<Self> {
        let covariance = c.covariance.as_ref().filter(|_| c.with_depth)?;
        let fitted = distances(c);
        let q = |q: f64| quantile(fitted.iter().copied(), q);
        let (near, middle, far) = (q(0.01), q(0.5), q(0.99));
        if !(near > 0.0 && far > near) {
            return None;
        }
        let few = c.camera.theta().len() > MANY;
        let (columns, steps) = if few { (9, 7) } else { (21, 17) };
        let rows = ((columns as f64 * c.camera.height as f64 / c.camera.width as f64).round() as usize).max(2);
        let (w, h) = (c.camera.width as f64 - 1.0, c.camera.height as f64 - 1.0);
        let base = typical(c, [0.0; 2]);
        let pixel = |t: [f64; 2]| Context { pixel: [t[0] * w, t[1] * h], ..base };
        let mut points = Vec::new();
        for z in [near, middle, far] {
            for i in 0..columns * rows {
                let t = [(i % columns) as f64 / (columns - 1) as f64, (i / columns) as f64 / (rows - 1) as f64];
                points.push((pixel(t), z));
            }
        }
        let curve_at: Vec<f64> =
            (0..steps).map(|i| 0.7 * near + (1.3 * far - 0.7 * near) * i as f64 / (steps - 1) as f64).collect();
        for t in [[0.5, 0.5], [0.25, 0.25], [0.03, 0.03]] {
            points.extend(curve_at.iter().map(|z| (pixel(t), *z)));
        }
        let std = standard_deviations(c, covariance, &points);
        let (maps, curves) = std.split_at(3 * columns * rows);
        let curve = |i: usize| curves[i * steps..(i + 1) * steps].to_vec();
        Some(Self {
            distances: vec![near, middle, far],
            grid: [columns, rows],
            maps: maps.chunks(columns * rows).map(<[f64]>::to_vec).collect(),
            curve_at,
            curves: [curve(0), curve(1), curve(2)],
            covered: [near, far],
        })
    }
}

/// Standard deviation of corrected depth, mm, at pixels with a measured depth (mm); NaN where depth cannot be corrected.
/// `covariance` is that of all parameters, with zeros for fixed ones.
fn standard_deviations(c: &CalibratedCamera, covariance: &DMatrix<f64>, points: &[(Context, f64)]) -> Vec<f64> {
    let depth = uncertain_depth_of(c, covariance, Context::default());
    points.par_iter().map(|(context, z)| depth.std_dev(context, *z).parameters_mm).collect()
}
