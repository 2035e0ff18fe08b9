//! The states at which pieces act on the observations of a fit, at the fitted poses.

use std::collections::BTreeSet;

use depthcal_model::{Block, Context, Quantities, Quantity};
use depthcal_statistics::{nearest_rank, quantile, rms};

use crate::calibrate::CalibratedCamera;
use crate::observe::board_plane::BoardPlane;

/// Most depth samples over which sizes are averaged.
const MOST_SAMPLES: usize = 6000;
/// Quantiles that bound the range of a covariate: single outliers do not widen it.
const RANGE_QUANTILES: [f64; 2] = [0.005, 0.995];

/// Chain states and covariates of a fit's observations.
#[derive(Debug, Clone, Default)]
pub struct ObservedStates {
    /// Input of depth pieces at the depth samples: ray (x, y), inverse depth ρ (1/mm), cosine of the angle of incidence.
    pub(super) depth: Vec<[f64; 4]>,
    /// Covariates of the depth samples.
    pub(super) contexts: Vec<Context>,
    /// Input of lens pieces at the markers: ray (x, y), inverse depth ρ, ray (x, y).
    pub(super) lens: Vec<[f64; 5]>,
    /// Input of board pieces at the markers: board points, mm.
    pub(super) board: Vec<[f64; 3]>,
    /// Number of markers of every frame, in the order of theirs.
    pub(super) markers_of_frames: Vec<usize>,
    /// The blocks of the camera.
    pub(super) model: Vec<Block>,
    /// Focal length along the image rows, px.
    pub(super) focal_px: f64,
    /// Root mean square noise of single depth pixels over the samples, mm.
    pub noise_mm: f64,
}

/// Range of a covariate over the depth samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// 0.5 % quantile.
    pub low: f64,
    /// Median.
    pub middle: f64,
    /// 99.5 % quantile.
    pub high: f64,
}

impl Range {
    /// The range of the finite ones among values; `None` where none is finite.
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let quantile = |q: f64| nearest_rank(&sorted, q);
        Some(Self { low: quantile(RANGE_QUANTILES[0])?, middle: quantile(0.5)?, high: quantile(RANGE_QUANTILES[1])? })
    }

    /// Length of the range.
    pub fn span(&self) -> f64 {
        self.high - self.low
    }
}

impl ObservedStates {
    /// The states of a fit's markers and depth samples.
    pub fn of(fit: &CalibratedCamera) -> Self {
        let (model, focal_px) = (fit.camera.blocks().to_vec(), fit.camera.pinhole()[0]);
        let mut states = Self { model, focal_px, ..Self::default() };
        let total: usize = fit.capture.frames.iter().map(|f| f.samples.len()).sum();
        let step = total.div_ceil(MOST_SAMPLES).max(1);
        for frame in &fit.capture.frames {
            let pose = &frame.camera_from_board;
            let plane = BoardPlane::new(pose);
            for sample in frame.samples.iter().step_by(step) {
                let Ok(ray) = fit.camera.ray(sample.context.pixel, 1.0 / sample.depth_mm) else { continue };
                let Some(state) = plane.depth_state(ray) else { continue };
                states.depth.push(state);
                states.contexts.push(sample.context);
            }
            states.markers_of_frames.push(frame.markers.len());
            for marker in &frame.markers {
                let [x, y] = fit.capture.target.point(marker.index);
                let point_in_camera = pose * nalgebra::Point3::new(x, y, 0.0);
                let rho = 1.0 / point_in_camera.z;
                let (a, b) = (point_in_camera.x * rho, point_in_camera.y * rho);
                states.lens.push([a, b, rho, a, b]);
                states.board.push([x, y, 0.0]);
            }
        }
        states.noise_mm = rms(states.depth.iter().map(|s| fit.noise.depth.sigma(s[2]) / (s[2] * s[2])));
        states
    }

    /// About so many depth samples, evenly spread: state (x, y, ρ, cosine of incidence) and covariates.
    pub fn spread(&self, count: usize) -> impl Iterator<Item = ([f64; 4], Context)> {
        let step = (self.depth.len() / count.max(1)).max(1);
        self.depth.iter().copied().zip(self.contexts.iter().copied()).step_by(step)
    }

    /// The quantities that the frames have besides time and temperature.
    pub fn quantities(&self) -> BTreeSet<Quantity> {
        Quantities::names_of(self.contexts.iter().map(|context| &context.quantities))
    }

    /// These quantities at their medians.
    pub fn usual_quantities(&self) -> Quantities {
        Quantities::summarized(self.contexts.iter().map(|context| &context.quantities), |values| quantile(values, 0.5))
    }

    /// Range over the depth samples of `value`, a function of state (x, y, ρ, cosine of incidence) and covariates.
    pub fn range(&self, value: impl Fn(&[f64; 4], &Context) -> f64) -> Option<Range> {
        Range::of(self.depth.iter().zip(&self.contexts).map(|(s, c)| value(s, c)))
    }
}
